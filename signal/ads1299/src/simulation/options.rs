//! Options of a simulated board: clock, wiring, signals at the electrodes, faults.

use std::boxed::Box;

use crate::decoder::{Alignment, CHANNELS};
use crate::register::Register;
use crate::settings::Wiring;

/// Clock, SCLK, wiring and noise seed of a simulated board.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Master clock of the chips, in Hz.
    pub clock_hz: u32,
    /// Connection of the chips' data outputs to MISO.
    pub wiring: Wiring,
    /// SCLK for registers, in Hz.
    pub register_hz: u32,
    /// SCLK for bursts, in Hz.
    pub burst_hz: u32,
    /// Spacing of the chips' parts in a frame, with or without a don't-care bit between two chips.
    pub alignment: Alignment,
    /// Resistor between MISO and the DOUT of each chip after chip 0 in a daisy chain, in ohms;
    /// `None` without resistors: then only chip 0 can be read.
    pub read_back_ohms: Option<u32>,
    /// Seed of the pseudo-random noise of all channels.
    pub seed: u64,
}

impl Default for Options {
    /// A daisy chain with a master clock of 2^21 Hz, SCLK of 100 kHz for registers and 16 MHz for
    /// bursts, a don't-care bit as in the data sheet, and resistors of 22 kOhm for read-back.
    fn default() -> Self {
        Self {
            clock_hz: 1 << 21,
            wiring: Wiring::Daisy,
            register_hz: 100_000,
            burst_hz: 16_000_000,
            alignment: Alignment::Spaced,
            read_back_ohms: Some(22_000),
            seed: 1,
        }
    }
}

/// Source of the electrodes' signal. The simulation calls the function once per sample, with the
/// sample's number, while any channel converts its electrodes. The numbers start at 0 and leave out
/// the samples of a self-test.
pub enum Electrodes<const CHIPS: usize> {
    /// Differential voltages in volts; the simulated chip applies gain and clipping and adds noise.
    Volts(Deliver<f64, CHIPS>),
    /// ADC counts, |count| <= 2^23, delivered exactly, whatever the gain, and without noise.
    Counts(Deliver<i32, CHIPS>),
}

/// Function that fills one sample, by chip and channel; its first argument is the sample's number.
pub type Deliver<T, const CHIPS: usize> = Box<dyn FnMut(u64, &mut [[T; CHANNELS]; CHIPS]) + Send>;

impl<const CHIPS: usize> Electrodes<CHIPS> {
    /// Returns electrodes at 0 V, so that the counts are the chips' noise.
    pub fn silent() -> Self {
        Self::Volts(Box::new(|_, volts| *volts = [[0.0; CHANNELS]; CHIPS]))
    }

    /// Returns electrodes whose voltages are computed by `deliver`, in volts, from the sample's
    /// number.
    pub fn volts(deliver: impl FnMut(u64, &mut [[f64; CHANNELS]; CHIPS]) + Send + 'static) -> Self {
        Self::Volts(Box::new(deliver))
    }

    /// Returns electrodes whose counts are computed by `deliver` from the sample's number.
    pub fn counts(
        deliver: impl FnMut(u64, &mut [[i32; CHANNELS]; CHIPS]) + Send + 'static,
    ) -> Self {
        Self::Counts(Box::new(deliver))
    }
}

/// Fault that a test injects into a simulated chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No power: accepts no command, DOUT low, DRDY high. Blocks the data of the chips after it.
    Dead,
    /// Sends the data of its last sample again, in every frame.
    StuckData,
    /// Returns this byte as its ID.
    WrongId(u8),
    /// Converts at twice the rate. Only chip 0 shows this fault, because only its DRDY is wired.
    DoubleRate,
    /// Omits the next edge of DRDY. Only chip 0 shows this fault, because only its DRDY is wired.
    MissedReady,
    /// Sends these four bits in place of 1100 at the start of its status word.
    WrongNibble(u8),
    /// Delays its data, and the data of the chips after it, by one bit.
    ShiftedBit,
    /// Ignores writes to this register.
    Forgets(Register),
}
