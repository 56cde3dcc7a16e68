//! Handle that controls the USB host from any thread.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::core::Core;
use super::host::descriptor::Descriptors;
use super::host::{Command, Host, State};
use super::violation::Violation;

/// Handle of the host at the other end of the USB cable; clones control the same host.
///
/// A command takes effect at the next stop of the emulator, at the latest when the current run of
/// the board ends.
#[derive(Clone, Debug)]
pub struct UsbHost(Arc<Mutex<Host>>);

impl Default for UsbHost {
    fn default() -> Self {
        Self::new()
    }
}

impl UsbHost {
    /// Creates a host whose cable is unplugged.
    pub fn new() -> Self {
        Self(Arc::new(Mutex::new(Host::new())))
    }

    fn host(&self) -> MutexGuard<'_, Host> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Executes a command of the user at the host, or of a program that uses the serial port.
    pub fn command(&self, command: Command) {
        self.host().commands.push_back(command);
    }

    /// Returns the bytes received since the last call, in order.
    pub fn take_received(&self) -> Vec<u8> {
        self.host().take_received()
    }

    /// Returns how far enumeration and opening of the port have progressed.
    pub fn state(&self) -> State {
        self.host().state()
    }

    /// Returns the parsed descriptors of the device; `None` until it is configured.
    pub fn device(&self) -> Option<Descriptors> {
        self.host().device()
    }

    /// Returns all violations of the reference manual and of the USB specification so far.
    pub fn violations(&self) -> Vec<Violation> {
        self.host().violations().to_vec()
    }

    /// Performs the work that is due at `now`, and returns the time at which work is due next; both
    /// times are in ns.
    pub(super) fn step(&self, now: u64, core: &mut Core) -> Option<u64> {
        self.host().step(now, core)
    }
}
