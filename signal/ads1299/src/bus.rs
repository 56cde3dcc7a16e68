//! SPI bus to the chips, with two clock speeds.

use embedded_hal_async::spi::SpiBus;

/// Kind of transfer; each kind has its own limit of SCLK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// Opcodes and registers: at most 105 kHz, because of the read-back resistors to MISO (decision
    /// 0011).
    Registers,
    /// Frames of samples: the board's fastest SCLK up to 20 MHz (data sheet section 7.6: a period of 50
    /// ns with DVDD from 2.7 V).
    Bursts,
}

/// The board's slowest SCLK is too fast for the requested [`Speed`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooFast {
    /// The board's slowest SCLK, in Hz.
    pub hz: u32,
}

/// SPI bus of a chain, mode 1. The driver selects the speed before each kind of transfer.
pub trait Bus: SpiBus {
    /// Changes SCLK. The driver calls this method only while no chip is selected.
    ///
    /// # Errors
    /// The board has no SCLK that is slow enough.
    fn set_speed(&mut self, speed: Speed) -> Result<(), TooFast>;
}
