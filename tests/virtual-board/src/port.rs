//! The host's end of a board's port.

use crate::serial::Serial;

/// The host's end of a board's port; clones are the same.
#[derive(Clone, Debug)]
pub struct Port(pub(crate) Serial);

impl Port {
    /// Puts bytes on their way to the device.
    pub fn send(&self, bytes: &[u8]) {
        self.0.line().send(bytes);
    }

    /// Takes what the device has sent.
    pub fn take(&self) -> Vec<u8> {
        self.0.line().take()
    }

    /// A host opens the port. A UART has no way to tell the device.
    pub const fn open(&self) {}

    /// The host closes it.
    pub const fn close(&self) {}

    /// Baud rate that the device sends with, once it has sent two bytes; none over USB.
    pub fn baud(&self) -> Option<u64> {
        self.0.line().baud()
    }
}
