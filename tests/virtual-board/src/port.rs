//! The host's end of a board's port.

use crate::serial::Serial;
use crate::usb::{State, UsbHost};

/// The host's end of a board's port; clones are the same.
#[derive(Clone, Debug)]
pub enum Port {
    /// The ST-LINK's serial port.
    Uart(Serial),
    /// A host at the USB cable.
    Usb(UsbHost),
}

impl Port {
    /// Puts bytes on their way to the device; over USB once the port is open.
    pub fn send(&self, bytes: &[u8]) {
        match self {
            Self::Uart(serial) => serial.line().send(bytes),
            Self::Usb(host) => host.send(bytes),
        }
    }

    /// Takes what the device has sent.
    pub fn take(&self) -> Vec<u8> {
        match self {
            Self::Uart(serial) => serial.line().take(),
            Self::Usb(host) => host.take_received(),
        }
    }

    /// A host opens the port. A UART has no way to tell the device.
    pub fn open(&self) {
        if let Self::Usb(host) = self {
            host.open();
        }
    }

    /// Opens the port again after the device has been away, as a program does that waits for it.
    pub(crate) fn keep_open(&self) {
        if let Self::Usb(host) = self
            && host.state() == State::Configured
        {
            host.open();
        }
    }

    /// Whether what the host sends reaches the device.
    pub fn is_open(&self) -> bool {
        match self {
            Self::Uart(_) => true,
            Self::Usb(host) => host.state() == State::Open,
        }
    }

    /// The host closes it.
    pub fn close(&self) {
        if let Self::Usb(host) = self {
            host.close();
        }
    }

    /// Baud rate that the device sends with, once it has sent two bytes; none over USB.
    pub fn baud(&self) -> Option<u64> {
        match self {
            Self::Uart(serial) => serial.line().baud(),
            Self::Usb(_) => None,
        }
    }

    /// The host at the USB cable, if there is one.
    pub const fn usb(&self) -> Option<&UsbHost> {
        match self {
            Self::Uart(_) => None,
            Self::Usb(host) => Some(host),
        }
    }
}
