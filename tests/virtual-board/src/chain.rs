//! The simulated converters at the microcontroller's pins.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ads1299::simulation::{Electrodes, Options, SimulatedChain, Simulation};
use embedded_hal::digital::OutputPin;
use rigless::chip::{Timeline, spi};
use rigless::snapshot::Store;

use crate::eeg;
use crate::model::Pins;
use crate::setup::Setup;

/// Converters on a board.
pub(crate) const CHIPS: usize = 8;

/// The chain and its wires; clones are the same.
#[derive(Clone, Debug)]
pub(crate) struct Chain(Arc<Mutex<Wires>>);

/// The wires between the chain and the microcontroller.
#[derive(Debug)]
pub(crate) struct Wires {
    simulation: Simulation<CHIPS>,
    chain: SimulatedChain<CHIPS>,
    /// Levels that the microcontroller drives: selects, START, RESET.
    levels: [Option<bool>; CHIPS + 2],
    sclk_hz: u32,
    /// Edges of DRDY that the microcontroller has seen.
    edges: u64,
    /// DRDY is low: a sample is ready and none of its bits were clocked.
    ready: bool,
    /// DRDY stays at this level, whatever the converters do.
    stuck: Option<bool>,
    /// Bytes that were clocked.
    bytes: u64,
    /// Widths that were clocked and are no byte.
    odd_words: u64,
}

/// What DRDY does at a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ready {
    /// It falls, after a pulse where it is low already.
    pub(crate) falls: bool,
    /// Its level.
    pub(crate) is_high: bool,
}

impl Chain {
    pub(crate) fn new(setup: &Setup) -> Self {
        let options = Options {
            alignment: setup.alignment,
            ..Options::default()
        };
        let electrodes = Electrodes::counts(|sample, counts| {
            for (channel, place) in counts.as_flattened_mut().iter_mut().enumerate() {
                *place = eeg::count(sample, channel);
            }
        });
        let simulation = Simulation::new(options, electrodes);
        let chain = simulation.chain();
        Self(Arc::new(Mutex::new(Wires {
            simulation,
            chain,
            levels: core::array::from_fn(|index| Some(index != CHIPS)),
            sclk_hz: 0,
            edges: 0,
            ready: false,
            stuck: None,
            bytes: 0,
            odd_words: 0,
        })))
    }

    pub(crate) fn wires(&self) -> MutexGuard<'_, Wires> {
        // A panic elsewhere leaves wires that are still worth a look.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Wires {
    pub(crate) const fn simulation(&self) -> &Simulation<CHIPS> {
        &self.simulation
    }

    pub(crate) const fn set_sclk(&mut self, hz: u32) {
        self.sclk_hz = hz;
    }

    pub(crate) const fn sclk_hz(&self) -> u32 {
        self.sclk_hz
    }

    pub(crate) const fn bytes(&self) -> u64 {
        self.bytes
    }

    pub(crate) const fn odd_words(&self) -> u64 {
        self.odd_words
    }

    pub(crate) const fn hold_ready(&mut self, level: Option<bool>) {
        self.stuck = level;
    }

    /// Takes the levels that the microcontroller drives now. Where a pin is no output, the resistors of the
    /// converters' board hold the wire: selects and RESET high, START low (docs/hardware.md).
    pub(crate) fn follow(
        &mut self,
        now_ns: u64,
        pins: &Pins,
        output: impl Fn(crate::chip::Pin) -> Option<bool>,
    ) {
        let all = pins.selects.iter().chain([&pins.start, &pins.reset]);
        for (index, pin) in all.enumerate() {
            let level = Some(output(*pin).unwrap_or(index != CHIPS));
            if level == self.levels[index] {
                continue;
            }
            self.levels[index] = level;
            self.simulation.advance_to(now_ns);
            let line = match index {
                CHIPS => &mut self.chain.start,
                index if index > CHIPS => &mut self.chain.reset,
                index => &mut self.chain.selects[index],
            };
            let set = line.set_state((level == Some(true)).into());
            set.unwrap_or_else(|never| match never {});
        }
    }

    /// Lets the chain's time pass, and returns what DRDY does.
    pub(crate) fn pass(&mut self, now_ns: u64) -> Ready {
        self.simulation.advance_to(now_ns);
        let edges = self.simulation.ready_edges();
        let mut falls = edges != self.edges;
        self.edges = edges;
        self.ready |= falls;
        let mut is_high = !self.ready;
        if let Some(level) = self.stuck {
            (falls, is_high) = (false, level);
        }
        Ready { falls, is_high }
    }

    /// When the next conversion ends, ns.
    pub(crate) fn next_edge_ns(&self) -> Option<u64> {
        self.simulation.next_edge_ns()
    }
}

impl Store for Chain {}

impl spi::Peer for Chain {
    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let mut wires = self.wires();
        wires.odd_words += u64::from(bits != 8);
        wires.bytes += 1;
        // The first bit that is clocked takes DRDY high (SBAS499C, 9.4.4.1).
        wires.ready = false;
        let [byte, ..] = mosi.to_le_bytes();
        let miso = wires
            .simulation
            .transfer_at(context.now().0, wires.sclk_hz, byte);
        u32::from(miso)
    }
}
