//! Model of the USB host, in virtual time.
//!
//! To make an idle bus cheap to emulate, the host sends a token only when the device would not
//! respond with NAK. Frames are counted, not sent.

mod control;
pub(crate) mod descriptor;
mod enumeration;
mod serial;
mod traffic;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use self::control::Transfer;
use self::descriptor::Descriptors;
use self::enumeration::Enumeration;
use self::serial::Serial;
use super::core::Core;
use super::violation::{Violation, Violations};

/// Time for which a new device must stay attached before its first reset, in ns (USB 2.0, 7.1.7.3:
/// TATTDB).
const DEBOUNCE_NS: u64 = 100_000_000;
/// Duration of a bus reset, in ns (USB 2.0, 7.1.7.5: TDRSTR of a root port).
const RESET_NS: u64 = 50_000_000;
/// Recovery time of the device after a reset, in ns (USB 2.0, 7.1.7.5: TRSTRCY).
const RECOVERY_NS: u64 = 10_000_000;
/// Idle time after which a device is suspended, in ns (USB 2.0, 7.1.7.6).
const SUSPEND_NS: u64 = 3_000_000;
/// Duration of resume signalling, in ns (USB 2.0, 7.1.7.7: TDRSMDN).
const RESUME_NS: u64 = 20_000_000;
/// Recovery time of the device after resume, in ns (USB 2.0, 7.1.7.7: TRSMRCY).
const RESUME_RECOVERY_NS: u64 = 10_000_000;
/// Number of enumerations that the host attempts before it ignores a device, as Linux does.
const ATTEMPTS: u32 = 3;
/// Number of actions at one virtual time after which the model of the host counts as stuck in an
/// endless loop.
const MAX_ACTIONS: usize = 1_000;

/// Handle of the host at the other end of the USB cable; clones control the same host.
///
/// A command takes effect at the next stop of the emulator, at the latest when the current run of
/// the board ends.
#[derive(Clone, Debug, Default)]
pub struct UsbHost(Arc<Mutex<Host>>);

impl UsbHost {
    fn host(&self) -> MutexGuard<'_, Host> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Executes a command of the user at the host, or of a program that uses the serial port.
    pub fn command(&self, command: Command) {
        self.host().commands.push_back(command);
    }

    /// Returns the bytes received since the last call, in order.
    pub fn take_received(&self) -> Vec<u8> {
        std::mem::take(&mut self.host().serial.received)
    }

    /// Returns how far enumeration and opening of the port have progressed.
    pub fn state(&self) -> State {
        self.host().state()
    }

    /// Returns the parsed descriptors of the device; `None` until it is configured.
    pub fn device(&self) -> Option<Descriptors> {
        self.host().device.clone()
    }

    /// Returns all violations of the reference manual and of the USB specification so far.
    pub fn violations(&self) -> Vec<Violation> {
        self.host().violations.to_vec()
    }

    /// Performs the work that is due at `now`, and returns the time at which work is due next; both
    /// times are in ns.
    pub(super) fn step(&self, now: u64, core: &mut Core) -> Option<u64> {
        self.host().step(now, core)
    }
}

/// State of the device as the host sees it; the variants are in the order in which a device
/// reaches them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// There is no device on the bus.
    Detached,
    /// The device has no address yet.
    Attached,
    /// The device has an address and is not configured.
    Addressed,
    /// The device is configured, its serial port is closed.
    Configured,
    /// The device is configured, and its serial port is open: DTR is set.
    Open,
}

/// Command that a [`UsbHost`] passes to the host.
#[derive(Clone, Debug)]
pub enum Command {
    /// Plug the cable in; the host then enumerates the device.
    Plug,
    /// Unplug the cable: VBUS goes off, and the host discards the device.
    Unplug,
    /// If true, open the serial port of a configured device: set the line coding, then DTR and RTS.
    /// If false, close it: clear DTR and RTS, then stop reading data.
    Open(bool),
    /// Pause or resume reading data from the device while the port is open.
    PauseReading(bool),
    /// If true, suspend the bus of a configured device: stop sending frames. If false, signal
    /// resume for 20 ms, then send frames again.
    Suspend(bool),
    /// Reset the bus and enumerate the device again, which closes the serial port.
    ResetBus,
    /// Send bytes once the serial port is open. Without a configured device they are dropped.
    Send(Vec<u8>),
}

/// Phase of the host's port; a number is the time at which the phase ends, in ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Unplugged,
    /// The cable is plugged in and no device is attached.
    Empty,
    Debounce(u64),
    Reset(u64),
    Recovery(u64),
    /// Transactions with the device are possible.
    Active,
    /// All attempts to enumerate the device have failed.
    Failed,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Power {
    #[default]
    Running,
    Suspended,
    Resuming(u64),
    Recovering(u64),
}

/// USB host: state of its bus, of the enumeration and of the serial port.
#[derive(Debug, Default)]
struct Host {
    commands: VecDeque<Command>,
    phase: Phase,
    power: Power,
    wants_suspend: bool,
    idle_since: Option<u64>,
    enumeration: Option<Enumeration>,
    attempts: u32,
    /// Control transfer in progress: of the enumeration if there is one, else of the serial port.
    transfer: Option<Transfer>,
    address: u8,
    serial: Serial,
    device: Option<Descriptors>,
    /// End of the last transaction, in ns.
    free_at: u64,
    /// End of the transaction in progress, in ns.
    busy_until: Option<u64>,
    violations: Violations,
}

impl Host {
    fn state(&self) -> State {
        match self.phase {
            Phase::Unplugged | Phase::Empty => State::Detached,
            _ if self.serial.is_open => State::Open,
            _ if self.device.is_some() => State::Configured,
            _ if self.address != 0 => State::Addressed,
            _ => State::Attached,
        }
    }

    fn step(&mut self, now: u64, core: &mut Core) -> Option<u64> {
        for _ in 0..MAX_ACTIONS {
            self.violations.take_from(&mut core.violations);
            while let Some(command) = self.commands.pop_front() {
                self.execute(command, now, core);
            }
            self.observe_bus(now, core);
            match self.next_due(now, core) {
                Some(at) if at <= now => self.perform(now, core),
                next => return next,
            }
        }
        self.violations
            .record(now, "the model of the host repeats actions without end");
        None
    }

    fn execute(&mut self, command: Command, now: u64, core: &mut Core) {
        match command {
            Command::Plug if self.phase == Phase::Unplugged => {
                self.phase = Phase::Empty;
                core.set_vbus(true);
            }
            Command::Unplug if self.phase != Phase::Unplugged => {
                self.discard_device(core);
                self.phase = Phase::Unplugged;
                core.set_vbus(false);
            }
            Command::Open(wanted) => self.serial.wanted = wanted && self.serial.is_connected(),
            Command::PauseReading(paused) => self.serial.is_paused = paused,
            Command::Suspend(wanted) => self.wants_suspend = wanted,
            Command::ResetBus if matches!(self.phase, Phase::Active | Phase::Failed) => {
                self.attempts = 0;
                self.restart_enumeration(now, core);
            }
            Command::Send(bytes) if self.serial.is_connected() => {
                self.serial.outgoing.extend(bytes);
            }
            Command::Plug | Command::Unplug | Command::ResetBus | Command::Send(_) => {}
        }
    }

    /// Discards all state of the device and stops sending frames.
    fn discard_device(&mut self, core: &mut Core) {
        self.transfer = None;
        self.enumeration = None;
        self.device = None;
        self.address = 0;
        self.busy_until = None;
        self.power = Power::Running;
        self.wants_suspend = false;
        self.serial.disconnect();
        core.set_frames(false);
    }

    /// Resets the bus and restarts the enumeration.
    fn restart_enumeration(&mut self, now: u64, core: &mut Core) {
        self.discard_device(core);
        self.enumeration = Some(Enumeration::new());
        self.reset_bus(now, core);
    }

    fn reset_bus(&mut self, now: u64, core: &mut Core) {
        core.set_frames(false);
        core.start_reset();
        self.phase = Phase::Reset(now + RESET_NS);
    }

    /// Detects that a device was attached or detached, and that the bus became idle.
    fn observe_bus(&mut self, now: u64, core: &mut Core) {
        let attached = core.is_attached();
        match self.phase {
            Phase::Empty if attached => {
                self.attempts = 0;
                self.phase = Phase::Debounce(now + DEBOUNCE_NS);
            }
            Phase::Unplugged | Phase::Empty => {}
            _ if !attached => {
                self.discard_device(core);
                self.phase = Phase::Empty;
            }
            _ => {}
        }
        let is_idle = core.is_idle() && !matches!(self.power, Power::Resuming(_));
        self.idle_since = is_idle.then(|| self.idle_since.unwrap_or(now));
        if core.signals_wakeup() {
            let text = "OTG_DCTL: RWUSIG, although the host has not enabled it (USB 2.0, 9.2.5.2)";
            self.violations.record(now, text);
        }
    }

    /// Returns the time at which work is due next, in ns.
    fn next_due(&mut self, now: u64, core: &Core) -> Option<u64> {
        let phase = match self.phase {
            Phase::Debounce(until) | Phase::Reset(until) | Phase::Recovery(until) => Some(until),
            _ => None,
        };
        let power = match self.power {
            Power::Resuming(until) | Power::Recovering(until) => Some(until),
            Power::Running | Power::Suspended => self.must_change_power().then_some(now),
        };
        let idle = self.idle_since.map(|since| since + SUSPEND_NS);
        let is_live = self.phase == Phase::Active && self.power == Power::Running;
        let traffic = is_live.then(|| self.traffic_due(now, core)).flatten();
        [phase, power, idle, traffic].into_iter().flatten().min()
    }

    /// Returns whether the bus must be suspended or resumed now.
    fn must_change_power(&self) -> bool {
        let is_suspended = self.power == Power::Suspended;
        let can_suspend =
            self.device.is_some() && self.transfer.is_none() && self.busy_until.is_none();
        self.wants_suspend != is_suspended && (is_suspended || can_suspend)
    }

    fn perform(&mut self, now: u64, core: &mut Core) {
        match (self.phase, self.power) {
            (Phase::Debounce(until), _) if until <= now => self.restart_enumeration(now, core),
            (Phase::Reset(until), _) if until <= now => {
                core.end_reset();
                core.set_frames(true);
                self.phase = Phase::Recovery(now + RECOVERY_NS);
            }
            (Phase::Recovery(until), _) if until <= now => self.phase = Phase::Active,
            (_, Power::Resuming(until)) if until <= now => {
                core.set_frames(true);
                self.power = Power::Recovering(now + RESUME_RECOVERY_NS);
            }
            (_, Power::Recovering(until)) if until <= now => self.power = Power::Running,
            (_, Power::Running) if self.must_change_power() => {
                core.set_frames(false);
                self.power = Power::Suspended;
            }
            (_, Power::Suspended) if self.must_change_power() => {
                core.resume();
                self.power = Power::Resuming(now + RESUME_NS);
            }
            _ if self
                .idle_since
                .is_some_and(|since| since + SUSPEND_NS <= now) =>
            {
                core.suspend();
            }
            _ => self.advance_traffic(now, core),
        }
    }

    /// Handles a failed enumeration: retries it, or ignores the device after the last attempt.
    fn enumeration_failed(&mut self, why: &str, now: u64, core: &mut Core) {
        self.attempts += 1;
        self.violations.record(now, format!("enumeration: {why}"));
        if self.attempts < ATTEMPTS {
            self.restart_enumeration(now, core);
        } else {
            self.discard_device(core);
            self.phase = Phase::Failed;
        }
    }
}

#[cfg(test)]
mod tests;
