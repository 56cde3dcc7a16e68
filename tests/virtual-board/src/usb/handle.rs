//! The handle by which tests and bridges use the host, from any thread.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::core::Core;
use super::host::{Command, Descriptors, Host, Logged};
use super::violation::Violation;

/// How far the host has got with the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// No device on the bus.
    Detached,
    /// A device without an address.
    Attached,
    /// A device with an address that is not configured.
    Addressed,
    /// A configured device whose serial port is closed.
    Configured,
    /// The serial port is open.
    Open,
}

/// What went over the bulk endpoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Packets from the device.
    pub packets_in: u64,
    /// Packets from the device without data.
    pub empty_packets_in: u64,
    /// Bytes from the device.
    pub bytes_in: u64,
    /// Packets to the device.
    pub packets_out: u64,
    /// Bytes to the device.
    pub bytes_out: u64,
}

/// The host at the other end of the USB cable.
///
/// A command takes effect when the emulator next stops: at the next instant the run was asked to reach, at
/// the latest. A clone is the same host.
#[derive(Clone, Debug)]
pub struct UsbHost(Arc<Mutex<Host>>);

impl Default for UsbHost {
    fn default() -> Self {
        Self::new()
    }
}

impl UsbHost {
    /// A host with the cable unplugged.
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

    /// Unplugs the cable.
    pub fn unplug(&self) {
        self.command(Command::Unplug);
    }

    /// Opens the serial port of a configured device: sets the line coding, then DTR and RTS.
    pub fn open(&self) {
        self.command(Command::Open(true));
    }

    /// Closes the serial port: clears DTR and RTS, then takes no more data.
    pub fn close(&self) {
        self.command(Command::Open(false));
    }

    /// Takes no data from the device although the port is open, or goes on.
    pub fn stall(&self, stalled: bool) {
        self.command(Command::Stall(stalled));
    }

    /// Suspends the bus of a configured device.
    pub fn suspend(&self) {
        self.command(Command::Suspend(true));
    }

    /// Resumes the bus.
    pub fn resume(&self) {
        self.command(Command::Suspend(false));
    }

    /// Resets the bus and enumerates the device again; a serial port that was open is closed.
    pub fn reset_bus(&self) {
        self.command(Command::ResetBus);
    }

    /// Sends `bytes` to the device once the serial port is open; dropped without a configured device.
    pub fn send(&self, bytes: &[u8]) {
        self.command(Command::Send(bytes.to_vec()));
    }

    /// The bytes received since the last call, each exactly once and in order.
    pub fn take_received(&self) -> Vec<u8> {
        self.host().take_received()
    }

    /// How far the host has got with the device.
    pub fn state(&self) -> State {
        self.host().state()
    }

    /// The device as its descriptors describe it, once it is configured.
    pub fn device(&self) -> Option<Descriptors> {
        self.host().device()
    }

    /// Packets and bytes of the bulk endpoints so far.
    pub fn counters(&self) -> Counters {
        self.host().counters()
    }

    /// What happened on the bus so far.
    pub fn log(&self) -> Vec<Logged> {
        self.host().log().to_vec()
    }

    /// Everything that a real core or a real host would not have accepted.
    pub fn violations(&self) -> Vec<Violation> {
        self.host().violations().to_vec()
    }

    /// Does what is due at `now`; the next instant at which something will be, ns.
    pub(super) fn step(&self, now: u64, core: &mut Core) -> Option<u64> {
        self.host().step(now, core)
    }
}
