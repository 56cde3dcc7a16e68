//! Simulated converters, their input, and how they are connected to the microcontroller.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ads1299::CHANNELS;
use ads1299::simulation::{Electrodes, Options, SimulatedChain, Simulation};
use embedded_hal::digital::OutputPin;
use rigless::chip::{Timeline, spi};
use rigless::snapshot::Store;

use crate::board::Setup;
use crate::model::{Pin, Pins};

/// Number of simulated ADS1299 chips. Those that a board lacks are never selected.
pub(crate) const CHIPS: usize = 8;

/// Handle of the simulated converters and their wires; all clones share one state.
#[derive(Clone, Debug)]
pub(crate) struct Chain(Arc<Mutex<Wires>>);

/// The simulated converters, and the state of the signals between them and the microcontroller.
#[derive(Debug)]
pub(crate) struct Wires {
    pub(crate) simulation: Simulation<CHIPS>,
    chain: SimulatedChain<CHIPS>,
    /// Levels last passed to the simulation: chip selects, START and RESET, in this order.
    levels: [Option<bool>; CHIPS + 2],
    /// Frequency in Hz of the SPI's clock SCLK; 0 before the firmware has configured it.
    pub(crate) sclk_hz: u32,
    /// Number of edges of DRDY that have been passed on to the microcontroller.
    edges: u64,
    /// True if a sample is ready and none of its bits have been clocked out; DRDY is low then.
    ready: bool,
    /// Level at which a test holds DRDY; `None` if the converters drive it.
    pub(crate) stuck: Option<bool>,
    /// Number of SPI words transferred so far.
    pub(crate) words: u64,
    /// Number of SPI words so far that were not 8 bits wide; the converters need 8 bits.
    pub(crate) non_byte_words: u64,
}

/// State of the signal DRDY at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DrdyState {
    /// DRDY falls at this instant; if it was low before, it is high for a short pulse first.
    pub(crate) falls: bool,
    pub(crate) is_high: bool,
}

impl Chain {
    pub(crate) fn new(setup: &Setup) -> Self {
        let options = Options {
            clock_hz: setup.converters.clock_hz,
            wiring: setup.converters.wiring,
            alignment: setup.alignment,
            ..Options::default()
        };
        let electrodes = Electrodes::counts(|sample, counts| {
            for (channel, place) in counts.as_flattened_mut().iter_mut().enumerate() {
                *place = electrode_count(sample, channel);
            }
        });
        let simulation = Simulation::new(options, electrodes);
        for channel in 0..CHIPS * CHANNELS {
            simulation.set_impedance(
                channel / CHANNELS,
                channel % CHANNELS,
                electrode_ohms(channel),
            );
        }
        let chain = simulation.chain();
        Self(Arc::new(Mutex::new(Wires {
            simulation,
            chain,
            levels: core::array::from_fn(|index| Some(index != CHIPS)),
            sclk_hz: 0,
            edges: 0,
            ready: false,
            stuck: None,
            words: 0,
            non_byte_words: 0,
        })))
    }

    pub(crate) fn wires(&self) -> MutexGuard<'_, Wires> {
        // Ignore that a thread has panicked while it held the lock: the state still helps a
        // diagnosis.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Wires {
    /// Passes the levels of the microcontroller's outputs on to the converters. A signal that no
    /// output drives has the level of its pull resistor on the converter board: high for selects
    /// and RESET, low for START (docs/hardware.md).
    pub(crate) fn set_outputs(
        &mut self,
        now_ns: u64,
        pins: &Pins,
        output: impl Fn(Pin) -> Option<bool>,
    ) {
        let selects = (0..CHIPS).map(|chip| pins.selects.get(chip).copied());
        let all = selects.chain([pins.start, pins.reset]);
        for (index, pin) in all.enumerate() {
            let level = Some(pin.and_then(&output).unwrap_or(index != CHIPS));
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

    /// Advances the simulated converters to `now_ns` and returns the state of DRDY at that time.
    pub(crate) fn advance_to(&mut self, now_ns: u64) -> DrdyState {
        self.simulation.advance_to(now_ns);
        let edges = self.simulation.ready_edges();
        let mut falls = edges != self.edges;
        self.edges = edges;
        self.ready |= falls;
        let mut is_high = !self.ready;
        if let Some(level) = self.stuck {
            (falls, is_high) = (false, level);
        }
        DrdyState { falls, is_high }
    }

    /// Returns the time at which the next conversion ends, in ns since power-on; `None` while no
    /// conversions run.
    pub(crate) fn next_edge_ns(&self) -> Option<u64> {
        self.simulation.next_edge_ns()
    }
}

impl Store for Chain {}

impl spi::Peer for Chain {
    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let mut wires = self.wires();
        wires.non_byte_words += u64::from(bits != 8);
        wires.words += 1;
        // DRDY returns to high with a transfer's first SCLK (data sheet SBAS499C, 9.4.4.1).
        wires.ready = false;
        let [byte, ..] = mosi.to_le_bytes();
        let miso = wires.simulation.transfer_at(context.now().0, wires.sclk_hz, byte);
        u32::from(miso)
    }
}

/// Returns the ADC count of `channel` (0 to 63) at `sample`: the sum of two sine waves between 9
/// and 28 Hz, an offset that depends on the channel, and noise. Its magnitude is below 2^13, and it
/// does not resemble EEG. All channels and samples differ, so a comparison detects exchanged ones.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "samples of hours are exact; the waves stay below 2^13"
)]
pub fn electrode_count(sample: u64, channel: usize) -> i32 {
    let seconds = sample as f64 / 512.0;
    let channel_number = channel as f64;
    let turns = std::f64::consts::TAU * seconds;
    let wave = 900.0 * (turns * (9.0 + channel_number * 0.07)).sin()
        + 400.0 * (turns * (21.0 + channel_number * 0.11)).cos()
        + 60.0 * (channel_number - 30.0);
    wave as i32 + noise(sample, channel)
}

/// Returns the impedance of the electrode at a channel, in ohms.
#[expect(clippy::cast_precision_loss, reason = "at most 64 channels")]
pub fn electrode_ohms(channel: usize) -> f64 {
    1_000.0 * (channel + 1) as f64
}

/// Returns noise from -128 to 127 that depends only on sample and channel. It is a hash of both,
/// the last stage of `splitmix64` (Steele, Lea and Flood 2014).
fn noise(sample: u64, channel: usize) -> i32 {
    let seed = sample << 6 | channel as u64 & 63;
    let mut mixed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    mixed = (mixed ^ mixed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    let byte = (mixed ^ mixed >> 31).to_le_bytes()[0];
    i32::from(byte) - 128
}
