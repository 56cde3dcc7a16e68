//! The bus to the chips, and its two speeds.

use embedded_hal_async::spi::SpiBus;

/// What is clocked, and so how fast SCLK may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// Registers, whose way back to MISO may be slow: the resistors of decision 0011 want 105 kHz
    /// at most.
    Registers,
    /// Frames of samples, and opcodes without an answer: at most 20 MHz (7.6: 50 ns with DVDD from
    /// 2.7 V), as fast as the board can below that.
    Bursts,
}

/// SCLK would be faster than what is clocked allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooFast {
    /// What the board can do that comes nearest, Hz.
    pub hz: u32,
}

/// The SPI of a chain, mode 1. The driver says which speed it wants before it clocks: registers are
/// read slowly, frames fast.
pub trait Bus: SpiBus {
    /// Changes SCLK; no chip is selected meanwhile.
    ///
    /// # Errors
    /// When the board has no SCLK that is slow enough.
    fn set_speed(&mut self, speed: Speed) -> Result<(), TooFast>;
}
