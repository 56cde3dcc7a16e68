//! The host's end of a virtual board's port: a serial line or USB.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::chip::{Timeline, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

use crate::usb::host::{Command, State, UsbHost};

/// The host's end of a virtual board's port; all clones share one connection.
#[derive(Clone, Debug)]
pub enum Port {
    /// The serial port that the ST-LINK provides.
    Uart(Serial),
    /// A host at the board's USB connector.
    Usb(UsbHost),
}

impl Port {
    /// Sends bytes to the device. Over USB, they wait until the port is open; without a configured
    /// device, they are discarded.
    pub fn send(&self, bytes: &[u8]) {
        match self {
            Self::Uart(serial) => serial.line().send(bytes),
            Self::Usb(host) => host.command(Command::Send(bytes.to_vec())),
        }
    }

    /// Returns the bytes that the device has sent since the last call.
    pub fn take_received(&self) -> Vec<u8> {
        match self {
            Self::Uart(serial) => serial.line().take_received(),
            Self::Usb(host) => host.take_received(),
        }
    }

    /// If the USB port is closed and the device is configured, opens the port, like a host program
    /// that waits for the device.
    pub(crate) fn keep_open(&self) {
        if let Self::Usb(host) = self
            && host.state() == State::Configured
        {
            host.command(Command::Open(true));
        }
    }

    /// Returns whether bytes that are sent now reach the device.
    pub fn is_open(&self) -> bool {
        match self {
            Self::Uart(_) => true,
            Self::Usb(host) => host.state() == State::Open,
        }
    }

    /// Closes a USB port; has no effect on a UART.
    pub fn close(&self) {
        if let Self::Usb(host) = self {
            host.command(Command::Open(false));
        }
    }

    /// Returns the device's baud rate, which follows from the shortest time between two bytes that
    /// it has sent; `None` over USB or before the first byte.
    pub fn baud(&self) -> Option<u64> {
        match self {
            Self::Uart(serial) => serial.line().baud(),
            Self::Usb(_) => None,
        }
    }

    /// Returns the simulated USB host; `None` for a UART.
    pub const fn usb(&self) -> Option<&UsbHost> {
        match self {
            Self::Uart(_) => None,
            Self::Usb(host) => Some(host),
        }
    }
}

/// The serial line between device and host; all clones share one state.
#[derive(Clone, Debug, Default)]
pub struct Serial(Arc<Mutex<Line>>);

/// Bytes in transit in both directions, and the timing of the device's bytes.
#[derive(Debug, Default)]
pub(crate) struct Line {
    to_host: Vec<u8>,
    to_device: VecDeque<u8>,
    /// Shortest time between two consecutive bytes from the device, in ns.
    shortest_ns: Option<u64>,
    /// Time at which the last byte from the device arrived, in ns.
    last_ns: u64,
}

impl Serial {
    pub(crate) fn line(&self) -> MutexGuard<'_, Line> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Line {
    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.to_device.extend(bytes);
    }

    pub(crate) fn take_received(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.to_host)
    }

    /// Returns the device's baud rate: ten bits in the shortest time between two bytes.
    pub(crate) fn baud(&self) -> Option<u64> {
        self.shortest_ns.map(|ns| 10_000_000_000 / ns.max(1))
    }
}

impl Store for Serial {}

impl uart::Peer for Serial {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        let mut line = self.line();
        let now = context.now().0;
        let since = now - line.last_ns;
        line.last_ns = now;
        line.shortest_ns = Some(line.shortest_ns.map_or(since, |least| least.min(since)));
        let [byte, _] = word.to_le_bytes();
        line.to_host.push(byte);
    }

    fn transmit(&mut self, _: VirtualNanos) -> Option<u16> {
        self.line().to_device.pop_front().map(u16::from)
    }
}
