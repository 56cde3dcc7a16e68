//! The loop that runs board, line and host in virtual time.

use std::sync::Arc;

use bridge_core::{Core, EventStamps, Model, Settings};
use link::{Encoder, Flags, MAX_FRAME, ResetCause, Streams, ToDevice};
use pipeline::Mains;
use thiserror::Error;

use super::clock::BoardClock;
use super::file::{FaultKind, LineKind, Scenario};
use super::ledger::Ledger;
use super::line::{CommandLine, Line};
use super::report::{Facts, Report};
use super::schedule::{Change, Schedule};
use super::signal::{Signal, SignalError};
use super::truth::{Content, Segment, Truth};
use crate::fault::{FaultError, Faults};
use crate::outbox::{Outbox, WhenFull};
use crate::virtual_board::{Identity, VirtualBoard};

/// Largest number of bytes that the bridge reads at once.
const READ_BYTES: usize = 4096;

/// Time that the host takes to handle a full read, microseconds.
const HANDLE_US: f64 = 500.0;

/// Wall clock at the start, nanoseconds since 1970.
const WALL_START_NS: i64 = 1_700_000_000_000_000_000;

/// Time limit of the final phase, microseconds. In this phase the line has no random faults, and
/// the board must confirm that it has stopped.
const STOP_US: f64 = 3e6;

/// Shortest time for which a board that restarts sends nothing, microseconds.
const BOOT_US: f64 = 50_000.0;

/// Why a scenario cannot be rehearsed.
#[derive(Debug, Error)]
pub enum RehearsalError {
    /// The signal cannot be opened, or ends too early.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// Faults of the converters overlap.
    #[error("the faults of the converters cannot be combined")]
    Faults(#[from] FaultError),
    /// The built-in model cannot be decoded.
    #[error("the built-in model cannot be decoded: {0}")]
    Model(String),
    /// The model has no network for codes, or the scenario streams raw samples although a converter
    /// runs at double rate, in which case they cannot be compared.
    #[error("{0}")]
    Streams(&'static str),
}

/// Events that can happen next. If several are due at the same time, they happen in this order.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Next {
    Change,
    Boot,
    Cut,
    Command,
    OtherProgram,
    Hangup,
    Open,
    Read,
    Tick,
}

/// Rehearses a scenario. Calls `on_second` after each second.
///
/// # Errors
/// [`RehearsalError`] if the scenario cannot run. The [`Report`] states whether it has passed.
pub fn rehearse(
    scenario: &Scenario,
    mut on_second: impl FnMut(),
) -> Result<Report, RehearsalError> {
    let mut rehearsal = Rehearsal::new(scenario)?;
    let end_us = scenario.duration_s * 1e6;
    let mut next_second_us = 1e6;
    while rehearsal.clock.host_us < end_us {
        rehearsal.advance()?;
        if rehearsal.clock.host_us >= next_second_us {
            next_second_us += 1e6;
            on_second();
        }
    }
    rehearsal.stop()?;
    Ok(rehearsal.report())
}

#[expect(clippy::struct_excessive_bools, reason = "independent states of board, port and line")]
struct Rehearsal<'s> {
    scenario: &'s Scenario,
    signal: Signal,
    /// Host time of the event that was handled last, microseconds.
    now_us: f64,
    clock: BoardClock,
    board: VirtualBoard,
    /// Frames that the board queues; emptied after each call to the board.
    outbox: Outbox,
    truth: Truth,
    line: Line,
    commands: CommandLine,
    schedule: Schedule,
    /// Host time at which a board without power runs again, microseconds; infinite while it runs.
    boot_us: f64,
    is_powered: bool,
    restart: ResetCause,
    /// The brown-out that occurs during the next frame: index of its fault, and microseconds
    /// without power.
    brown_out: (usize, f64),
    loses_acks: bool,
    /// Values of the counters of lost acknowledgements and of received commands when the latest
    /// fault that reads the counter began or ended.
    lost_before: u64,
    commands_before: u32,
    is_unplugged: bool,
    /// Commands of another program: host time of the next command, and interval between commands,
    /// microseconds.
    other_us: f64,
    other_every_us: f64,
    other: Encoder,
    core: Box<Core>,
    ledger: Ledger,
    is_open: bool,
    /// Whether the open port has been unplugged.
    has_hung_up: bool,
    /// Whether the port is present under the name that the bridge looks for.
    is_findable: bool,
    open_us: f64,
    tick_us: f64,
    ticks: u32,
    /// Host time until which the host does not run, and the earliest time of its next read.
    stalled_us: f64,
    read_us: f64,
    /// Bytes that the host has read since the last zero, which ends a frame.
    segment: Vec<u8>,
    facts: Facts,
}

impl<'s> Rehearsal<'s> {
    fn new(scenario: &'s Scenario) -> Result<Self, RehearsalError> {
        let streams = scenario.streams;
        if streams.contains(Streams::CODES) && !model::HAS_NETWORK {
            let why = "the built-in model has no network; write streams = [\"packed\"]";
            return Err(RehearsalError::Streams(why));
        }
        let raw = Streams::RAW.bits() | Streams::COMPRESSED_RAW.bits();
        let doubles = scenario.converters.iter().any(crate::Fault::doubles_rate);
        if doubles && streams.bits() & raw != 0 {
            let why = "samples are not compared while a converter runs at double rate; leave out one of both";
            return Err(RehearsalError::Streams(why));
        }
        let (signal, substitutes) = Signal::open(&scenario.source)?;
        let model = Model::embedded().map_err(|error| RehearsalError::Model(error.to_string()))?;
        let packed_rate = model.packed().map(|packed| packed.description.rate);
        let settings = Settings {
            streams,
            announced: scenario.announced(),
            event_stamps: EventStamps::Scalp,
            packed_rate,
            ..Settings::default()
        };
        let identity = Identity { session_id: 1, chip_uid: *b"\0scenario\0\0\0", substitutes };
        let outbox = Outbox::new(WhenFull::DropOldest);
        let faults = Faults::new(&scenario.converters)?;
        let board = VirtualBoard::with_faults(identity, Mains::Hz50, faults, outbox.clone());
        let mut rehearsal = Self {
            scenario,
            signal,
            clock: BoardClock::new(scenario.clock.clone()),
            board: board.with_trigger(scenario.trigger_every_s),
            outbox,
            truth: Truth::default(),
            line: Line::new(scenario),
            commands: CommandLine::new(scenario),
            schedule: Schedule::new(scenario),
            boot_us: f64::INFINITY,
            is_powered: true,
            restart: ResetCause::PowerOn,
            brown_out: (0, 0.0),
            now_us: 0.0,
            loses_acks: false,
            lost_before: 0,
            commands_before: 0,
            is_unplugged: false,
            other_us: f64::INFINITY,
            other_every_us: f64::INFINITY,
            // These frame numbers start far from those of the bridge's own commands.
            other: Encoder::starting_at(1 << 31),
            core: Box::new(Core::new(settings, Some(Arc::new(model)))),
            ledger: Ledger::new(WALL_START_NS, scenario.limits.settle_s),
            is_open: false,
            has_hung_up: false,
            is_findable: true,
            open_us: 0.0,
            tick_us: 0.0,
            ticks: 0,
            stalled_us: 0.0,
            read_us: 0.0,
            segment: Vec::new(),
            facts: Facts::default(),
        };
        rehearsal.queue_frames(0.0);
        Ok(rehearsal)
    }

    /// Handles all events that are due up to the time of the next sample, then the sample.
    fn advance(&mut self) -> Result<(), RehearsalError> {
        let sample_us = self.clock.next_sample_us();
        while let (us, next) = self.next()
            && us <= sample_us
        {
            self.handle(next, us);
        }
        self.clock.advance();
        self.now_us = sample_us;
        let sample = self.signal.next_sample()?;
        if !self.is_powered {
            return Ok(());
        }
        let before = self.board.stats().samples;
        self.board.process_sample(&sample, self.clock.device_us(sample_us));
        if self.board.stats().samples != before {
            let counts = self.board.converters().sampler().counts().as_flattened();
            self.truth.record_sample(counts[..model::CHANNELS].iter().copied());
        }
        self.queue_frames(sample_us);
        Ok(())
    }

    /// Records the frames that the board has made, and queues them for the line.
    fn queue_frames(&mut self, now_us: f64) {
        for frame in self.outbox.take_all() {
            let made = self.truth.record(&frame, &self.clock);
            if let Content::Rows(kind, rows) = &made.content {
                for row in rows {
                    self.ledger.topics[*kind as usize].record_made(row);
                }
            }
            if self.loses_acks && matches!(made.content, Content::Ack) {
                self.facts.acks_lost += 1;
                continue;
            }
            for _ in 0..self.line.push(&frame, now_us) {
                self.outbox.count_dropped();
            }
        }
    }

    /// Returns the next event and its host time.
    fn next(&self) -> (f64, Next) {
        let running = |us: f64| us.max(self.stalled_us);
        let when = |condition: bool, us: f64| if condition { us } else { f64::INFINITY };
        let poll_us = self.scenario.host.poll_ms * 1e3;
        let mut read_us = self.line.next_arrival_us().max(self.read_us);
        if poll_us > 0.0 {
            read_us = (read_us / poll_us).ceil() * poll_us;
        }
        let cut_us = self.line.cut_us().unwrap_or(f64::INFINITY);
        let candidates = [
            (self.schedule.next_us(), Next::Change),
            (self.boot_us, Next::Boot),
            (when(self.is_powered, cut_us), Next::Cut),
            (self.commands.next_arrival_us(), Next::Command),
            (self.other_us, Next::OtherProgram),
            (when(self.has_hung_up, running(0.0)), Next::Hangup),
            (when(!self.is_open, running(self.open_us)), Next::Open),
            (when(self.is_open && !self.has_hung_up, running(read_us)), Next::Read),
            (running(self.tick_us), Next::Tick),
        ];
        let mut first = candidates[0];
        for candidate in candidates {
            if candidate.0 < first.0 {
                first = candidate;
            }
        }
        first
    }

    fn handle(&mut self, next: Next, us: f64) {
        // Whatever was due while the host was stalled happens now.
        let now_us = us.max(self.now_us);
        self.now_us = now_us;
        match next {
            Next::Change => self.change(now_us),
            Next::Boot => self.boot(now_us),
            Next::Cut => {
                let (fault, off_us) = self.brown_out;
                self.schedule.effects[fault] += 1;
                self.lose_power(now_us, off_us);
            }
            Next::Command => {
                let bytes = self.commands.receive();
                if self.is_powered && self.line.is_up() {
                    let was_streaming = self.board.is_streaming();
                    self.board.receive(&bytes, self.clock.device_us(now_us));
                    if !was_streaming && self.board.is_streaming() {
                        self.truth.start_run();
                    }
                    self.queue_frames(now_us);
                }
            }
            Next::OtherProgram => {
                self.other_us += self.other_every_us;
                let command = [ToDevice::Ping, ToDevice::Identify];
                let command = &command[self.other.next_seq() as usize % 2];
                let mut buffer = [0; MAX_FRAME];
                if let Ok(frame) = self.other.encode(0, command, &mut buffer) {
                    self.commands.send(frame, now_us);
                }
            }
            Next::Hangup => self.close(now_us),
            Next::Open => self.open(now_us),
            Next::Read => {
                let bytes = self.line.read(now_us, READ_BYTES);
                self.read_us = now_us;
                if bytes.len() == READ_BYTES {
                    self.read_us += HANDLE_US;
                }
                self.read(&bytes, now_us);
            }
            Next::Tick => self.tick(now_us),
        }
        self.send_commands(now_us);
        self.line.carry(now_us);
    }

    fn send_commands(&mut self, now_us: f64) {
        for frame in std::mem::take(&mut self.ledger.commands) {
            self.commands.send(&frame, now_us);
        }
    }

    /// Passes bytes to the core, as one read of the bridge does. The bytes are divided at the ends
    /// of frames, to know which frame causes each effect of the core.
    fn read(&mut self, bytes: &[u8], now_us: f64) {
        let now = self.ledger.host_time(now_us);
        for part in bytes.split_inclusive(|byte| *byte == 0) {
            let ends = part.last() == Some(&0);
            self.segment.extend_from_slice(&part[..part.len() - usize::from(ends)]);
            let mut frame = None;
            if ends && !self.segment.is_empty() {
                match self.truth.identify(&self.segment) {
                    Segment::Frame(made) => {
                        self.facts.arrived += 1;
                        frame = Some(made);
                    }
                    Segment::Again => self.facts.repeated += 1,
                    Segment::Damaged => self.facts.damaged += 1,
                }
                self.segment.clear();
            }
            self.ledger.handle(frame, now);
            self.core.handle(part, now, &mut self.ledger);
        }
        self.core.tick(now, &mut self.ledger);
    }

    fn tick(&mut self, now_us: f64) {
        let tick_us = Core::TICK.as_secs_f64() * 1e6;
        // Ticks that were missed are skipped.
        self.tick_us = ((now_us / tick_us).floor() + 1.0) * tick_us;
        let now = self.ledger.host_time(now_us);
        self.core.tick(now, &mut self.ledger);
        self.ticks += 1;
        if self.ticks.is_multiple_of(Core::TICKS_PER_REPORT) {
            self.ledger.diagnostics = self.core.diagnostics(now);
        }
        let limit = match self.scenario.line.kind {
            LineKind::Usb | LineKind::Uart => Core::TTY_SILENCE_LIMIT,
            LineKind::Tcp => Core::TCP_SILENCE_LIMIT,
        };
        if self.is_open && self.core.is_unresponsive(now, limit) {
            self.close(now_us);
        }
    }

    fn open(&mut self, now_us: f64) {
        self.open_us = now_us + Core::REOPEN_AFTER.as_secs_f64() * 1e6;
        if self.is_findable && self.line.is_up() {
            self.is_open = true;
            self.segment.clear();
            let now = self.ledger.host_time(now_us);
            self.core.connected(now, &mut self.ledger);
        }
    }

    fn close(&mut self, now_us: f64) {
        self.has_hung_up = false;
        self.is_open = false;
        self.open_us = now_us + Core::REOPEN_AFTER.as_secs_f64() * 1e6;
        self.core.disconnected();
        self.ledger.commands.clear();
    }

    /// Interrupts the line, as unplugging the cable or restarting a board with its own USB port
    /// does.
    fn interrupt(&mut self, now_us: f64) {
        self.line.set_up(false, now_us);
        self.commands.lose();
        self.has_hung_up = self.is_open && self.scenario.line.kind != LineKind::Tcp;
    }

    fn change(&mut self, now_us: f64) {
        let Some((change, fault)) = self.schedule.take() else {
            return;
        };
        let Change { begins, fault: number, occurrence, .. } = change;
        let for_us = fault.for_s * 1e6;
        let effect = match (fault.kind, begins) {
            (FaultKind::Unplug, true) => {
                let effect = self.is_open;
                self.is_unplugged = true;
                self.interrupt(now_us);
                effect
            }
            (FaultKind::Unplug, false) => {
                self.is_unplugged = false;
                self.is_findable &= !fault.renumbered || self.scenario.host.port_auto;
                self.line
                    .set_up(self.is_powered || self.scenario.line.kind != LineKind::Usb, now_us);
                false
            }
            (FaultKind::Stall, true) => {
                self.stalled_us = self.stalled_us.max(now_us + for_us);
                true
            }
            (FaultKind::Restart, true) => {
                let effect = self.board.is_streaming();
                self.restart = ResetCause::Pin;
                self.lose_power(now_us, for_us.max(BOOT_US));
                effect
            }
            (FaultKind::BrownOut, true) => {
                self.restart = ResetCause::BrownOut;
                self.brown_out = (number, for_us.max(BOOT_US));
                self.line.cut_after(1 + occurrence);
                false
            }
            (FaultKind::LostAcks, begins) => {
                self.loses_acks = begins;
                let before = std::mem::replace(&mut self.lost_before, self.facts.acks_lost);
                !begins && self.facts.acks_lost > before
            }
            (FaultKind::Commands, begins) => {
                self.other_every_us = 1e6 / fault.per_s.unwrap_or(1.0);
                self.other_us = if begins { now_us } else { f64::INFINITY };
                let commands = self.board.stats().commands;
                let before = std::mem::replace(&mut self.commands_before, commands);
                // Half of the commands must arrive; the bridge's own commands, which also count,
                // are few.
                let expected = fault.for_s * fault.per_s.unwrap_or(1.0) / 2.0;
                !begins && f64::from(commands.wrapping_sub(before)) > expected
            }
            (FaultKind::WallClock, true) => {
                self.ledger.step_wall_clock(fault.step_s.unwrap_or_default(), now_us);
                true
            }
            _ => false,
        };
        self.schedule.effects[number] += u64::from(effect);
        if !begins && fault.kind != FaultKind::BrownOut && fault.kind != FaultKind::Restart {
            self.ledger.record_fault_end(now_us);
        }
    }

    /// Cuts the board's power for `off_us` microseconds, which ends its run.
    fn lose_power(&mut self, now_us: f64, off_us: f64) {
        self.line.lose_queue(now_us);
        if self.scenario.line.kind == LineKind::Usb {
            self.interrupt(now_us);
        }
        self.is_powered = false;
        self.boot_us = now_us + off_us;
    }

    fn boot(&mut self, now_us: f64) {
        self.boot_us = f64::INFINITY;
        self.is_powered = true;
        self.clock.reboot(now_us);
        self.line.set_up(!self.is_unplugged, now_us);
        self.board.restart(self.restart, 0);
        self.truth.start_run();
        self.ledger.unsettle(now_us);
        self.ledger.record_fault_end(now_us);
        self.facts.restarts += 1;
        self.queue_frames(now_us);
    }

    /// Stops the board as the bridge does when it ends, on a line without random faults.
    fn stop(&mut self) -> Result<(), RehearsalError> {
        self.line.faults.silence();
        self.commands.silence();
        let until_us = self.clock.host_us + STOP_US;
        // Let the board stream on until everything on the way has arrived.
        let drain_us = self.clock.host_us + STOP_US / 2.0;
        while self.clock.host_us < drain_us {
            self.advance()?;
        }
        self.core.set_streaming(false);
        while self.clock.host_us < until_us && !self.core.is_stopped() {
            self.advance()?;
        }
        let now = self.ledger.host_time(self.clock.host_us);
        self.ledger.diagnostics = self.core.diagnostics(now);
        Ok(())
    }

    fn report(mut self) -> Report {
        self.facts.dropped_by_board = self.line.dropped_by_board;
        self.facts.unreceived = self.line.unreceived;
        self.facts.line = self.line.faults.counts;
        self.facts.is_stopped = self.core.is_stopped();
        let bad = Flags::ADC_STATUS_BAD | Flags::LEAD_OFF | Flags::OVERRUN;
        let seen = |flags: Flags| self.truth.flags.bits() & flags.bits() != 0;
        self.facts.converters_seen = seen(bad);
        self.facts.rails_seen = seen(Flags::SATURATED | Flags::SUBSTITUTED);
        Report::new(
            self.scenario,
            &self.core.summary(),
            &self.ledger,
            &self.truth,
            &self.schedule,
            &self.facts,
        )
    }
}
