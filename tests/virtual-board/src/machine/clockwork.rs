//! What happens at each stop of the emulator: pins, converters, orders.

use std::collections::VecDeque;
use std::fmt;
use std::sync::mpsc::{Receiver, Sender};

use rigless::emulator::{AccessKind, Driver, HitKind, Host, Settled, Stop, StopReason, Watch};
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::board::Nucleo;
use crate::chain::Chain;
use crate::injection::Change;
use crate::model::Pins;
use crate::processor::Observer;

/// Resets within [`RESTARTS_NS`] that are no longer restarts but a loop.
const RESTARTS: usize = 20;
const RESTARTS_NS: u64 = 1_000_000_000;

/// Longest time between two stops, ns: bytes that wait for the UART are looked for at each.
const LONGEST_NS: u64 = 250_000;

/// What the board's user asks for.
pub(super) enum Order {
    /// Run up to this time, ns.
    Run(u64),
    /// Edges of the trigger: when, ns, and the level.
    Trigger(Vec<(u64, bool)>),
    /// Change the core when it arrives at an address.
    Inject(u64, Change),
    /// Look at the session.
    Look(Look),
    /// Power off.
    End,
}

/// A look at the session while time stands still.
pub(super) type Look = Box<dyn FnOnce(&mut Session<Nucleo>, &mut dyn Host) + Send>;

impl fmt::Debug for Order {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Run(ns) => write!(formatter, "Run({ns})"),
            Self::Trigger(edges) => write!(formatter, "Trigger({})", edges.len()),
            Self::Inject(address, _) => write!(formatter, "Inject({address:#x})"),
            Self::Look(_) => formatter.write_str("Look"),
            Self::End => formatter.write_str("End"),
        }
    }
}

/// Where the emulator stands.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reached {
    pub(super) instructions: u64,
    /// The board restarts again and again: it stands at the last of these resets.
    pub(super) restarts: bool,
}

/// The board's own time.
pub(super) struct Clockwork {
    pins: &'static Pins,
    chain: Chain,
    observer: Observer,
    /// What to change, and at which address.
    injection: Option<(u64, Change)>,
    orders: Receiver<Order>,
    reached: Sender<Reached>,
    /// Up to when it may run, ns.
    until_ns: u64,
    trigger: VecDeque<(u64, bool)>,
    trigger_is_high: bool,
    /// Levels of DRDY and trigger that the pins have.
    driven: [Option<bool>; 2],
    resets: usize,
    restarts: bool,
}

impl Clockwork {
    pub(super) fn new(
        pins: &'static Pins,
        chain: Chain,
        observer: Observer,
        orders: Receiver<Order>,
        reached: Sender<Reached>,
    ) -> Self {
        Self {
            pins,
            chain,
            observer,
            injection: None,
            orders,
            reached,
            until_ns: 0,
            trigger: VecDeque::new(),
            trigger_is_high: false,
            driven: [None; 2],
            resets: 0,
            restarts: false,
        }
    }

    /// Brings the pins to where converters and trigger drive them now.
    fn drive(&mut self, session: &mut Session<Nucleo>, now: VirtualNanos) {
        let resets = session.resets().len();
        if resets != self.resets {
            // The part has new pins.
            self.resets = resets;
            self.driven = [None; 2];
        }
        let ready = self.chain.wires().pass(now.0);
        let chip = &mut session.board_mut().chip;
        if ready.falls && self.driven[0] == Some(false) {
            // Nobody has read the sample before: DRDY is high for a moment (SBAS499C, 9.4.1).
            chip.drive(now, self.pins.drdy, true);
            chip.drive(now, self.pins.drdy, false);
        }
        if self.driven[0] != Some(ready.is_high) {
            chip.drive(now, self.pins.drdy, ready.is_high);
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
        self.driven = [Some(ready.is_high), Some(self.trigger_is_high)];
    }

    /// Stops a board that does nothing but restart: each takes the emulator far longer than the board.
    fn count_reset(&mut self, session: &mut Session<Nucleo>, now: VirtualNanos) {
        let chip = &session.board().chip;
        let mut wires = self.chain.wires();
        wires.follow(now.0, self.pins, |pin| chip.output(pin));
        drop(wires);
        let resets = session.resets();
        let first = resets
            .len()
            .checked_sub(RESTARTS)
            .and_then(|index| resets.get(index));
        if first.is_some_and(|first| now.0 - first.at.0 < RESTARTS_NS) {
            self.restarts = true;
            session.pause_at(Some(now));
        }
    }

    fn inject(&mut self, host: &mut dyn Host) {
        let Some((address, change)) = self.injection.take() else {
            return;
        };
        host.unwatch(Watch::Instruction(address));
        for (place, byte) in change
            .memory
            .iter()
            .flat_map(|(start, bytes)| (*start..).zip(bytes))
        {
            host.write(place, Width::W8, u64::from(*byte))
                .expect("the spare memory is there");
        }
        self.observer.set_registers(&change.registers);
    }

    /// The next moment that matters.
    fn next(&self, now: VirtualNanos) -> VirtualNanos {
        let mut next = (now.0 + LONGEST_NS).min(self.until_ns);
        let trigger = self.trigger.front().map(|&(at, _)| at);
        for at in [self.chain.wires().next_edge_ns(), trigger]
            .into_iter()
            .flatten()
        {
            next = next.min(at);
        }
        VirtualNanos(next.max(now.0 + 1))
    }
}

impl Driver<Nucleo> for Clockwork {
    /// Follows what the firmware does to the converters' wires.
    fn on_settled(&mut self, session: &mut Session<Nucleo>, host: &mut dyn Host, settled: Settled) {
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
            wires.follow(access.virtual_time.0, self.pins, |pin| chip.output(pin));
        } else if block == self.pins.spi {
            self.chain.wires().set_sclk(chip.sclk_hz());
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Nucleo>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        self.drive(session, stop.at);
        if stop.at.0 >= self.until_ns || self.restarts {
            let reached = Reached {
                instructions: stop.instruction_count,
                restarts: std::mem::take(&mut self.restarts),
            };
            if self.until_ns > 0 {
                self.reached.send(reached).ok()?;
            }
            loop {
                match self.orders.recv().ok()? {
                    Order::Run(ns) if ns > stop.at.0 => {
                        self.until_ns = ns;
                        break;
                    }
                    Order::Run(_) => self.reached.send(reached).ok()?,
                    Order::Trigger(edges) => self.trigger.extend(edges),
                    Order::Inject(address, change) => {
                        host.watch(Watch::Instruction(address));
                        self.injection = Some((address, change));
                    }
                    Order::Look(look) => look(session, host),
                    Order::End => return None,
                }
            }
        }
        Some(self.next(stop.at))
    }
}
