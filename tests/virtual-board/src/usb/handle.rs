//! Handle that controls the USB host from any thread.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::core::Core;
use super::host::descriptor::Descriptors;
use super::host::event::Logged;
use super::host::status::{Counters, State};
use super::host::{Command, Host};
use super::violation::Violation;

/// Handle of the host at the other end of the USB cable; clones control the same host.
///
/// A command takes effect at the next stop of the emulator, at the latest when the current run of the board
/// ends.
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

    fn command(&self, command: Command) {
        self.host().commands.push_back(command);
    }

    /// Plugs the cable in; the host then enumerates the device.
    pub fn plug(&self) {
        self.command(Command::Plug);
    }

    /// Unplugs the cable: VBUS goes off, and the host discards the device.
    pub fn unplug(&self) {
        self.command(Command::Unplug);
    }

    /// Opens the serial port of a configured device: sets the line coding, then DTR and RTS.
    pub fn open(&self) {
        self.command(Command::Open(true));
    }

    /// Closes the serial port: clears DTR and RTS, then stops reading data.
    pub fn close(&self) {
        self.command(Command::Open(false));
    }

    /// Pauses or resumes reading data from the device while the port is open.
    pub fn pause_reading(&self, paused: bool) {
        self.command(Command::PauseReading(paused));
    }

    /// Suspends the bus of a configured device: the host stops sending frames.
    pub fn suspend(&self) {
        self.command(Command::Suspend(true));
    }

    /// Resumes the bus: the host signals resume for 20 ms, then sends frames again.
    pub fn resume(&self) {
        self.command(Command::Suspend(false));
    }

    /// Resets the bus and enumerates the device again, which closes the serial port.
    pub fn reset_bus(&self) {
        self.command(Command::ResetBus);
    }

    /// Sends bytes once the serial port is open. Without a configured device the bytes are dropped.
    pub fn send(&self, bytes: &[u8]) {
        self.command(Command::Send(bytes.to_vec()));
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

    /// Returns the traffic counters of the bulk endpoints.
    pub fn counters(&self) -> Counters {
        self.host().counters()
    }

    /// Returns the log of all events on the bus so far.
    pub fn log(&self) -> Vec<Logged> {
        self.host().log().to_vec()
    }

    /// Returns all violations of the reference manual and of the USB specification so far.
    pub fn violations(&self) -> Vec<Violation> {
        self.host().violations().to_vec()
    }

    /// Performs the work that is due at `now`, and returns the time at which work is due next; both times
    /// are in ns.
    pub(super) fn step(&self, now: u64, core: &mut Core) -> Option<u64> {
        self.host().step(now, core)
    }
}
