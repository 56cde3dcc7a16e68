//! Options of a simulated board.

use crate::alignment::Alignment;

/// Options of a simulated board.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Master clock of the chips, in Hz.
    pub clock_hz: u32,
    /// SCLK for registers, in Hz.
    pub register_hz: u32,
    /// SCLK for bursts, in Hz.
    pub burst_hz: u32,
    /// Whether the chips insert a don't-care bit between two of them.
    pub alignment: Alignment,
    /// Whether every chip that is selected alone drives MISO; otherwise only chip 0 does.
    pub read_back: bool,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Options {
    /// 2^21 Hz, SCLK of 100 kHz and 16 MHz, a don't-care bit as in the data sheet, read-back of every chip.
    fn default() -> Self {
        Self {
            clock_hz: 1 << 21,
            register_hz: 100_000,
            burst_hz: 16_000_000,
            alignment: Alignment::Spaced,
            read_back: true,
            seed: 1,
        }
    }
}
