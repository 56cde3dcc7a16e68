//! The host at the other end of the cable, in virtual time.
//!
//! It does something only while something is to be done: a token that the device would answer with NAK is
//! not sent until it would not, so that an idle bus costs nothing. Frames are counted, not sent.

mod control;
pub(crate) mod descriptor;
mod enumeration;
pub(crate) mod event;
mod serial;
pub(crate) mod status;
mod traffic;

use std::collections::VecDeque;

use self::control::Transfer;
use self::descriptor::Descriptors;
use self::enumeration::Enumeration;
use self::event::{Event, Logged};
use self::serial::{Request, Serial};
use self::status::{Counters, State};
use super::core::Core;
use super::violation::Violations;

/// How long a new device must stay before it is reset, ns (USB 2.0, 7.1.7.3: TATTDB).
const DEBOUNCE_NS: u64 = 100_000_000;
/// How long the bus is reset, ns (USB 2.0, 7.1.7.5: TDRSTR of a root port).
const RESET_NS: u64 = 50_000_000;
/// How long the device may recover from a reset, ns (USB 2.0, 7.1.7.5: TRSTRCY).
const RECOVERY_NS: u64 = 10_000_000;
/// Idle time after which a device is suspended, ns (USB 2.0, 7.1.7.6).
const SUSPEND_NS: u64 = 3_000_000;
/// How long resume is signalled, ns (USB 2.0, 7.1.7.7: TDRSMDN).
const RESUME_NS: u64 = 20_000_000;
/// How long the device may recover from resume, ns (USB 2.0, 7.1.7.7: TRSMRCY).
const RESUME_RECOVERY_NS: u64 = 10_000_000;
/// Enumerations before the host leaves a device alone, as Linux does.
const ATTEMPTS: u32 = 3;
/// Things the host may do at one instant before the model counts as stuck.
const SAME_INSTANT: usize = 1_000;

/// What a test or a bridge asks of the host.
#[derive(Clone, Debug)]
pub(super) enum Command {
    Plug,
    Unplug,
    Open(bool),
    Stall(bool),
    Suspend(bool),
    ResetBus,
    Send(Vec<u8>),
}

/// What the port is doing, until when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Unplugged,
    /// The cable is in, no device shows itself.
    Empty,
    Debounce(u64),
    Reset(u64),
    Recovery(u64),
    /// The device may be talked to.
    Active,
    /// The device could not be enumerated.
    Failed,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Power {
    Running,
    Suspended,
    Resuming(u64),
    Recovering(u64),
}

/// Why a control transfer is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Enumerate,
    Serial(Request),
}

/// The host.
#[derive(Debug)]
pub(super) struct Host {
    pub(super) commands: VecDeque<Command>,
    phase: Phase,
    power: Power,
    wants_suspend: bool,
    idle_since: Option<u64>,
    enumeration: Option<Enumeration>,
    attempts: u32,
    transfer: Option<(Purpose, Transfer)>,
    address: u8,
    serial: Serial,
    device: Option<Descriptors>,
    /// When the last transaction ended, ns.
    free_at: u64,
    /// When the transaction on the wire ends, ns.
    busy_until: Option<u64>,
    log: Vec<Logged>,
    violations: Violations,
}

impl Host {
    /// A host with nothing plugged in.
    pub(super) fn new() -> Self {
        Self {
            commands: VecDeque::new(),
            phase: Phase::Unplugged,
            power: Power::Running,
            wants_suspend: false,
            idle_since: None,
            enumeration: None,
            attempts: 0,
            transfer: None,
            address: 0,
            serial: Serial::default(),
            device: None,
            free_at: 0,
            busy_until: None,
            log: Vec::new(),
            violations: Violations::default(),
        }
    }

    pub(super) fn state(&self) -> State {
        match self.phase {
            Phase::Unplugged | Phase::Empty => State::Detached,
            _ if self.serial.is_open => State::Open,
            _ if self.device.is_some() => State::Configured,
            _ if self.address != 0 => State::Addressed,
            _ => State::Attached,
        }
    }

    pub(super) fn device(&self) -> Option<Descriptors> {
        self.device.clone()
    }

    pub(super) fn log(&self) -> &[Logged] {
        &self.log
    }

    pub(super) fn violations(&self) -> &Violations {
        &self.violations
    }

    pub(super) fn take_received(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.serial.received)
    }

    pub(super) fn counters(&self) -> Counters {
        self.serial.counters
    }

    fn note(&mut self, now: u64, event: Event) {
        self.log.push(Logged { at_ns: now, event });
    }

    /// Does what is due at `now`. The next instant at which something will be, ns.
    pub(super) fn step(&mut self, now: u64, core: &mut Core) -> Option<u64> {
        for _ in 0..SAME_INSTANT {
            self.violations.take_from(&mut core.violations);
            while let Some(command) = self.commands.pop_front() {
                self.command(command, now, core);
            }
            self.watch(now, core);
            match self.due(now, core) {
                Some(at) if at <= now => self.act(now, core),
                next => return next,
            }
        }
        self.violations
            .record(now, "the model of the host does not come to rest");
        None
    }

    fn command(&mut self, command: Command, now: u64, core: &mut Core) {
        match command {
            Command::Plug if self.phase == Phase::Unplugged => {
                self.phase = Phase::Empty;
                self.note(now, Event::Plugged);
                core.set_vbus(true);
            }
            Command::Unplug if self.phase != Phase::Unplugged => {
                self.forget(core);
                self.phase = Phase::Unplugged;
                self.note(now, Event::Unplugged);
                core.set_vbus(false);
            }
            Command::Open(wanted) => self.serial.wanted = wanted && self.serial.is_connected(),
            Command::Stall(stalled) => self.serial.stalled = stalled,
            Command::Suspend(wanted) => self.wants_suspend = wanted,
            Command::ResetBus if matches!(self.phase, Phase::Active | Phase::Failed) => {
                self.attempts = 0;
                self.start_over(now, core);
            }
            Command::Send(bytes) if self.serial.is_connected() => {
                self.serial.outgoing.extend(bytes);
            }
            Command::Plug | Command::Unplug | Command::ResetBus | Command::Send(_) => {}
        }
    }

    /// Forgets the device and stops sending frames.
    fn forget(&mut self, core: &mut Core) {
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

    /// Resets the bus and enumerates from the beginning.
    fn start_over(&mut self, now: u64, core: &mut Core) {
        self.forget(core);
        self.enumeration = Some(Enumeration::new());
        self.reset_bus(now, core);
    }

    fn reset_bus(&mut self, now: u64, core: &mut Core) {
        core.set_frames(false);
        core.begin_reset();
        self.phase = Phase::Reset(now + RESET_NS);
    }

    /// Notices a device that comes or goes, and a bus that is idle.
    fn watch(&mut self, now: u64, core: &mut Core) {
        let attached = core.is_attached();
        match self.phase {
            Phase::Empty if attached => {
                self.attempts = 0;
                self.phase = Phase::Debounce(now + DEBOUNCE_NS);
                self.note(now, Event::Attached);
            }
            Phase::Unplugged | Phase::Empty => {}
            _ if !attached => {
                self.forget(core);
                self.phase = Phase::Empty;
                self.note(now, Event::Detached);
            }
            _ => {}
        }
        let is_idle = core.is_idle() && !matches!(self.power, Power::Resuming(_));
        self.idle_since = is_idle.then(|| self.idle_since.unwrap_or(now));
        if core.signals_wakeup() {
            let text = "OTG_DCTL: RWUSIG, although the host has not allowed it (USB 2.0, 9.2.5.2)";
            self.violations.record(now, text);
        }
    }

    /// When the next thing is due.
    fn due(&mut self, now: u64, core: &Core) -> Option<u64> {
        let phase = match self.phase {
            Phase::Debounce(until) | Phase::Reset(until) | Phase::Recovery(until) => Some(until),
            _ => None,
        };
        let power = match self.power {
            Power::Resuming(until) | Power::Recovering(until) => Some(until),
            Power::Running | Power::Suspended => self.changes_power().then_some(now),
        };
        let idle = self.idle_since.map(|since| since + SUSPEND_NS);
        let is_live = self.phase == Phase::Active && self.power == Power::Running;
        let traffic = is_live.then(|| self.traffic_due(now, core)).flatten();
        [phase, power, idle, traffic].into_iter().flatten().min()
    }

    /// Whether the bus is to be suspended or resumed now.
    fn changes_power(&self) -> bool {
        let is_suspended = self.power == Power::Suspended;
        let may = self.device.is_some() && self.transfer.is_none() && self.busy_until.is_none();
        self.wants_suspend != is_suspended && (is_suspended || may)
    }

    fn act(&mut self, now: u64, core: &mut Core) {
        match (self.phase, self.power) {
            (Phase::Debounce(until), _) if until <= now => self.start_over(now, core),
            (Phase::Reset(until), _) if until <= now => {
                core.end_reset();
                core.set_frames(true);
                self.phase = Phase::Recovery(now + RECOVERY_NS);
                self.note(now, Event::BusReset);
            }
            (Phase::Recovery(until), _) if until <= now => self.phase = Phase::Active,
            (_, Power::Resuming(until)) if until <= now => {
                core.set_frames(true);
                self.power = Power::Recovering(now + RESUME_RECOVERY_NS);
            }
            (_, Power::Recovering(until)) if until <= now => {
                self.power = Power::Running;
                self.note(now, Event::Resumed);
            }
            (_, Power::Running) if self.changes_power() => {
                core.set_frames(false);
                self.power = Power::Suspended;
                self.note(now, Event::Suspended);
            }
            (_, Power::Suspended) if self.changes_power() => {
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

    /// An enumeration has gone wrong: tries again, or leaves the device alone.
    fn enumeration_failed(&mut self, why: String, now: u64, core: &mut Core) {
        self.attempts += 1;
        self.violations.record(now, format!("enumeration: {why}"));
        self.note(now, Event::EnumerationFailed(why));
        if self.attempts < ATTEMPTS {
            self.start_over(now, core);
        } else {
            self.forget(core);
            self.phase = Phase::Failed;
        }
    }
}

#[cfg(test)]
mod tests;
