//! Model of the USB host, in virtual time.
//!
//! To make an idle bus cheap to emulate, the host sends a token only if the device would not
//! respond with NAK, and counts frames without sending them.

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

/// Time in ns for which a new device must stay attached before its first reset (USB 2.0, 7.1.7.3:
/// TATTDB).
const DEBOUNCE_NS: u64 = 100_000_000;
/// Duration of a bus reset, in ns (USB 2.0, 7.1.7.5: TDRSTR of a root port).
const RESET_NS: u64 = 50_000_000;
/// Time in ns that a device has to recover after a bus reset (USB 2.0, 7.1.7.5: TRSTRCY).
const RECOVERY_NS: u64 = 10_000_000;
/// Time in ns after which an idle bus means that the device is suspended (USB 2.0, 7.1.7.6).
const SUSPEND_NS: u64 = 3_000_000;
/// Time in ns for which the host signals resume (USB 2.0, 7.1.7.7: TDRSMDN).
const RESUME_NS: u64 = 20_000_000;
/// Time in ns that a device has to recover after resume (USB 2.0, 7.1.7.7: TRSMRCY).
const RESUME_RECOVERY_NS: u64 = 10_000_000;
/// Number of attempts to enumerate a device before the host ignores it, as Linux does.
const ATTEMPTS: u32 = 3;
/// Number of actions at the same virtual time after which the host's model counts as stuck in an
/// endless loop.
const MAX_ACTIONS: usize = 1_000;

/// The host at the other end of the USB cable; all clones control the same host.
///
/// A command takes effect at the next stop of the emulator, at the latest when the current run of
/// the board ends.
#[derive(Clone, Debug, Default)]
pub struct UsbHost(Arc<Mutex<Host>>);

impl UsbHost {
    fn host(&self) -> MutexGuard<'_, Host> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the host a command, as its user or a program that uses the serial port would.
    pub fn command(&self, command: Command) {
        self.host().commands.push_back(command);
    }

    /// Returns the bytes that the host has received from the device since the last call, in order.
    pub fn take_received(&self) -> Vec<u8> {
        std::mem::take(&mut self.host().serial.received)
    }

    /// Returns how far the host has come in enumerating the device and opening its serial port.
    pub fn state(&self) -> State {
        self.host().state()
    }

    /// Returns the contents of the device's descriptors; `None` until the device is configured.
    pub fn device(&self) -> Option<Descriptors> {
        self.host().device.clone()
    }

    /// Returns all violations of the reference manual and the USB specification so far.
    pub fn violations(&self) -> Vec<Violation> {
        self.host().violations.to_vec()
    }

    /// Does what the host has to do at the time `now`, and returns when it has to do something
    /// next; both times are in ns.
    pub(super) fn step(&self, now: u64, core: &mut Core) -> Option<u64> {
        self.host().step(now, core)
    }
}

/// State of the device as the host sees it, in the order in which a device goes through the states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// No device is attached to the bus.
    Detached,
    /// The device is attached and has no address yet.
    Attached,
    /// The device has an address, but is not configured.
    Addressed,
    /// The device is configured, but its serial port is closed.
    Configured,
    /// The device is configured, and its serial port is open, which DTR signals.
    Open,
}

/// A command that a test gives to the host.
#[derive(Clone, Debug)]
pub enum Command {
    /// Plug the cable in; the host then enumerates the device.
    Plug,
    /// Unplug the cable: VBUS goes off, and the host forgets the device.
    Unplug,
    /// With true, open the serial port of a configured device: set the line coding, then DTR and
    /// RTS. With false, close it: clear DTR and RTS, then stop reading data.
    Open(bool),
    /// With true, stop reading data from the device while the port is open; with false, continue.
    PauseReading(bool),
    /// With true, suspend the bus of a configured device by sending no more frames. With false,
    /// signal resume for 20 ms, then send frames again.
    Suspend(bool),
    /// Reset the bus and enumerate the device again; this closes the serial port.
    ResetBus,
    /// Send bytes as soon as the serial port is open; discard them if no device is configured.
    Send(Vec<u8>),
}

/// Phase of the host's port; a number is the time in ns at which the phase ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Unplugged,
    /// The cable is plugged in, but no device is attached.
    Empty,
    Debounce(u64),
    Reset(u64),
    Recovery(u64),
    /// The host can exchange packets with the device.
    Active,
    /// All attempts to enumerate the device have failed, so the host ignores it.
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

/// The USB host: state of the bus, of the enumeration and of the serial port.
#[derive(Debug, Default)]
struct Host {
    commands: VecDeque<Command>,
    phase: Phase,
    power: Power,
    wants_suspend: bool,
    idle_since: Option<u64>,
    enumeration: Option<Enumeration>,
    attempts: u32,
    /// Control transfer in progress, of the enumeration if there is one, else of the serial port.
    transfer: Option<Transfer>,
    address: u8,
    serial: Serial,
    device: Option<Descriptors>,
    /// Time at which the last transaction ended, in ns.
    free_at: u64,
    /// Time at which the transaction in progress ends, in ns; `None` if there is none.
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
        self.violations.record(now, "the model of the host repeats actions without end");
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

    /// Forgets all that is known of the device and stops sending frames.
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

    /// Resets the bus and starts a new enumeration of the device.
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

    /// Detects that a device has been attached or detached, and records since when the bus is idle.
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

    /// Returns the time in ns at which the host next has to act; `None` if nothing is due.
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

    /// Returns whether the host must suspend or resume the bus now.
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
            _ if self.idle_since.is_some_and(|since| since + SUSPEND_NS <= now) => {
                core.suspend();
            }
            _ => self.advance_traffic(now, core),
        }
    }

    /// Handles a failed enumeration: starts another, or ignores the device after [`ATTEMPTS`].
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
