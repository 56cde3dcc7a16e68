//! The host's end of a board's port: serial line or USB.

use crate::serial::Serial;
use crate::usb::handle::UsbHost;
use crate::usb::host::status::State;

/// The host's end of a board's port; clones share one connection.
#[derive(Clone, Debug)]
pub enum Port {
    /// The ST-LINK's serial port.
    Uart(Serial),
    /// A host at the board's USB connector.
    Usb(UsbHost),
}

impl Port {
    /// Sends bytes to the device. Over USB, the bytes wait until the port is open, and are dropped if no
    /// device is configured.
    pub fn send(&self, bytes: &[u8]) {
        match self {
            Self::Uart(serial) => serial.line().send(bytes),
            Self::Usb(host) => host.send(bytes),
        }
    }

    /// Returns the bytes that the device has sent since the last call.
    pub fn take_received(&self) -> Vec<u8> {
        match self {
            Self::Uart(serial) => serial.line().take_received(),
            Self::Usb(host) => host.take_received(),
        }
    }

    /// Opens the port. This has no effect on a UART.
    pub fn open(&self) {
        if let Self::Usb(host) = self {
            host.open();
        }
    }

    /// Opens a closed USB port if the device is configured, like a program that waits for the device.
    pub(crate) fn keep_open(&self) {
        if let Self::Usb(host) = self
            && host.state() == State::Configured
        {
            host.open();
        }
    }

    /// Returns whether bytes sent now reach the device.
    pub fn is_open(&self) -> bool {
        match self {
            Self::Uart(_) => true,
            Self::Usb(host) => host.state() == State::Open,
        }
    }

    /// Closes the port. This has no effect on a UART.
    pub fn close(&self) {
        if let Self::Usb(host) = self {
            host.close();
        }
    }

    /// Returns the device's baud rate, calculated from the shortest interval between two bytes that the
    /// device has sent; `None` over USB or before the first byte.
    pub fn baud(&self) -> Option<u64> {
        match self {
            Self::Uart(serial) => serial.line().baud(),
            Self::Usb(_) => None,
        }
    }

    /// Returns the USB host; `None` for a UART.
    pub const fn usb(&self) -> Option<&UsbHost> {
        match self {
            Self::Uart(_) => None,
            Self::Usb(host) => Some(host),
        }
    }
}
