//! Clock, SCLK and wiring of a simulated board.

use crate::alignment::Alignment;

/// Clock, SCLK, wiring and noise seed of a simulated board.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Master clock of the chips, in Hz.
    pub clock_hz: u32,
    /// SCLK for registers, in Hz.
    pub register_hz: u32,
    /// SCLK for bursts, in Hz.
    pub burst_hz: u32,
    /// Spacing of the chips' parts in a frame, with or without a don't-care bit between two chips.
    pub alignment: Alignment,
    /// True if a chip that is selected alone drives MISO; false if only chip 0 drives it.
    pub read_back: bool,
    /// Seed of the pseudo-random noise of all channels.
    pub seed: u64,
}

impl Default for Options {
    /// 2^21 Hz, SCLK of 100 kHz for registers and 16 MHz for bursts, a don't-care bit as in the
    /// data sheet, read-back of every chip.
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
