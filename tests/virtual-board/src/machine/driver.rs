//! Work at each stop of the emulator: drives pins, advances the converters, serves requests.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender};

use rigless::emulator::{AccessKind, Driver, HitKind, Host, Settled, Stop, StopReason, Watch};
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::board::EmulatedBoard;
use crate::chain::Chain;
use crate::injection::Change;
use crate::model::Pins;
use crate::processor::Observer;

/// A board with this many resets within [`RESET_LOOP_NS`] counts as resetting in a loop.
const RESET_LOOP: usize = 20;
const RESET_LOOP_NS: u64 = 1_000_000_000;

/// Longest virtual time in ns between two stops of the emulator; at each stop, the UART takes the
/// bytes that wait for it.
const MAX_RUN_NS: u64 = 250_000;

/// Request that a [`VirtualBoard`](crate::VirtualBoard) sends to the emulator's thread.
pub(super) enum Request {
    /// Run until this virtual time, in ns, then report the [`Progress`].
    Run(u64),
    /// Schedule edges of the trigger input, each with its time in ns and the level after it.
    Trigger(Vec<(u64, bool)>),
    /// Apply the change to registers and memory when the core reaches this address.
    Inject(u64, Change),
    /// Run the closure on the emulator's session.
    Inspect(Inspection),
    /// End the emulation.
    PowerOff,
}

/// Closure that runs on the emulator's session while virtual time is stopped.
pub(super) type Inspection = Box<dyn FnOnce(&mut Session<EmulatedBoard>, &mut dyn Host) + Send>;

/// Progress of the emulator when it reaches a requested stop.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Progress {
    /// Number of instructions completed since power-on.
    pub(super) instructions: u64,
    /// True if the run ended early because the board resets in a loop.
    pub(super) is_reset_loop: bool,
}

/// Drives the board's pins and serves requests whenever the emulator stops and calls it.
pub(super) struct BoardDriver {
    pins: &'static Pins,
    chain: Chain,
    observer: Observer,
    /// Pending failure: the address at which it applies, and the changes that cause it.
    injection: Option<(u64, Change)>,
    requests: Receiver<Request>,
    reached: Sender<Progress>,
    /// Virtual time in ns of the last requested stop; 0 before the first request.
    until_ns: u64,
    /// Edges of the trigger input still to come: time in ns, and level after the edge.
    trigger: VecDeque<(u64, bool)>,
    trigger_is_high: bool,
    /// Levels to which DRDY and the trigger pin were last driven; `None` after a reset.
    driven: [Option<bool>; 2],
    /// Number of resets of the chip that `drive` has seen.
    resets: usize,
    is_reset_loop: bool,
}

impl BoardDriver {
    pub(super) fn new(
        pins: &'static Pins,
        chain: Chain,
        observer: Observer,
        requests: Receiver<Request>,
        reached: Sender<Progress>,
    ) -> Self {
        Self {
            pins,
            chain,
            observer,
            injection: None,
            requests,
            reached,
            until_ns: 0,
            trigger: VecDeque::new(),
            trigger_is_high: false,
            driven: [None; 2],
            resets: 0,
            is_reset_loop: false,
        }
    }

    /// Drives the pins DRDY and trigger to the levels that they have at the time `now`.
    fn drive(&mut self, session: &mut Session<EmulatedBoard>, now: VirtualNanos) {
        let resets = session.resets().len();
        if resets != self.resets {
            // The emulator forgets the pins' levels at a reset, so drive them all again.
            self.resets = resets;
            self.driven = [None; 2];
        }
        let drdy = self.chain.wires().advance_to(now.0);
        let chip = &mut session.board_mut().chip;
        if drdy.falls && self.driven[0] == Some(false) {
            // The firmware has not read the previous sample, so DRDY is high for a pulse before it
            // falls (data sheet SBAS499C, section 9.4.1).
            chip.drive(now, self.pins.drdy, true);
            chip.drive(now, self.pins.drdy, false);
        }
        if self.driven[0] != Some(drdy.is_high) {
            chip.drive(now, self.pins.drdy, drdy.is_high);
        }
        while let Some(&(at, is_high)) = self.trigger.front()
            && at <= now.0
        {
            self.trigger.pop_front();
            self.trigger_is_high = is_high;
        }
        if self.driven[1] != Some(self.trigger_is_high) {
            chip.drive(now, self.pins.trigger, self.trigger_is_high);
        }
        self.driven = [Some(drdy.is_high), Some(self.trigger_is_high)];
    }

    /// Passes the levels of the output pins after a reset on to the converters. Stops a board that
    /// resets in a loop, because a reset takes far longer to emulate than on the chip.
    fn count_reset(&mut self, session: &mut Session<EmulatedBoard>, now: VirtualNanos) {
        let chip = &session.board().chip;
        let mut wires = self.chain.wires();
        wires.set_outputs(now.0, self.pins, |pin| chip.driven_level(pin));
        drop(wires);
        let resets = session.resets();
        let first = resets.len().checked_sub(RESET_LOOP).and_then(|index| resets.get(index));
        if first.is_some_and(|first| now.0 - first.at.0 < RESET_LOOP_NS) {
            self.is_reset_loop = true;
            session.pause_at(Some(now));
        }
    }

    fn inject(&mut self, host: &mut dyn Host) {
        let Some((address, change)) = self.injection.take() else {
            return;
        };
        host.unwatch(Watch::Instruction(address));
        for (place, byte) in change.memory.iter().flat_map(|(start, bytes)| (*start..).zip(bytes)) {
            host.write(place, Width::W8, u64::from(*byte)).expect("the spare memory is mapped");
        }
        self.observer.set_registers(&change.registers);
    }

    /// Returns the time of the next edge of DRDY or the trigger, or of the requested stop,
    /// whichever is first, but at the latest [`MAX_RUN_NS`] after `now`.
    fn next_stop(&self, now: VirtualNanos) -> VirtualNanos {
        let mut next = (now.0 + MAX_RUN_NS).min(self.until_ns);
        let trigger = self.trigger.front().map(|&(at, _)| at);
        for at in [self.chain.wires().next_edge_ns(), trigger].into_iter().flatten() {
            next = next.min(at);
        }
        VirtualNanos(next.max(now.0 + 1))
    }
}

impl Driver<EmulatedBoard> for BoardDriver {
    /// Passes the firmware's writes to pins and SPI settings on to the converters, handles resets,
    /// and applies a pending failure.
    fn on_settled(
        &mut self,
        session: &mut Session<EmulatedBoard>,
        host: &mut dyn Host,
        settled: Settled,
    ) {
        let access = match settled {
            Settled::Access { access, .. } => access,
            Settled::Stop(stop) if stop.reason == StopReason::Reset => {
                return self.count_reset(session, stop.at);
            }
            Settled::Hit(hit) if hit.kind == HitKind::Instruction => return self.inject(host),
            _ => return,
        };
        if access.kind != AccessKind::Write {
            return;
        }
        let chip = &session.board().chip;
        let block = access.address & !0x3FF;
        if block == self.pins.select_port {
            let mut wires = self.chain.wires();
            wires.set_outputs(access.virtual_time.0, self.pins, |pin| chip.driven_level(pin));
        } else if block == self.pins.spi {
            self.chain.wires().sclk_hz = chip.sclk_hz();
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<EmulatedBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        self.drive(session, stop.at);
        if stop.at.0 >= self.until_ns || self.is_reset_loop {
            let progress = Progress {
                instructions: stop.instruction_count,
                is_reset_loop: std::mem::take(&mut self.is_reset_loop),
            };
            if self.until_ns > 0 {
                self.reached.send(progress).ok()?;
            }
            loop {
                match self.requests.recv().ok()? {
                    Request::Run(ns) if ns > stop.at.0 => {
                        self.until_ns = ns;
                        break;
                    }
                    Request::Run(_) => self.reached.send(progress).ok()?,
                    Request::Trigger(edges) => self.trigger.extend(edges),
                    Request::Inject(address, change) => {
                        host.watch(Watch::Instruction(address));
                        self.injection = Some((address, change));
                    }
                    Request::Inspect(inspection) => inspection(session, host),
                    Request::PowerOff => return None,
                }
            }
        }
        Some(self.next_stop(stop.at))
    }
}
