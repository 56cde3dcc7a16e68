//! The host's end of the UART: the ST-LINK's serial port.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::chip::{Timeline, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// The serial line between device and host; clones share one state.
#[derive(Clone, Debug, Default)]
pub struct Serial(Arc<Mutex<Line>>);

/// Bytes in transit in both directions, and the timing of those from the device.
#[derive(Debug, Default)]
pub(crate) struct Line {
    to_host: Vec<u8>,
    to_device: VecDeque<u8>,
    /// Shortest time between two bytes from the device, in ns.
    shortest_ns: Option<u64>,
    /// Time of arrival of the last byte from the device, in ns.
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

    /// Returns the baud rate of the device: ten bits per shortest time between two bytes.
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
