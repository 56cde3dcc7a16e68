//! Traits that a board implements: the SPI bus with two clock speeds, and the edges of DRDY.

use embedded_hal_async::spi::SpiBus;

/// Kind of transfer; each kind has its own limit on SCLK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// Opcodes and registers: at most 105 kHz, because of the read-back resistors of a daisy chain.
    Registers,
    /// Frames of samples: the board's fastest SCLK that does not exceed 20 MHz (data sheet section
    /// 7.6: a period of 50 ns with DVDD from 2.7 V).
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

/// A falling edge of DRDY, which reports a new sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrdyEdge {
    /// Device time of the edge, in microseconds.
    pub us: u64,
    /// Number of earlier edges that were missed because nothing waited for them in time.
    pub missed: u32,
}

/// DRDY of chip 0, and the monotonic clock that stamps its edges in microseconds.
#[expect(async_fn_in_trait, reason = "an executor of one priority polls it; it need not be Send")]
pub trait Drdy {
    /// Returns the current time, in microseconds, of the clock that stamps the edges.
    fn now_us(&self) -> u64;

    /// Waits at most until time `us` for an edge of DRDY that no earlier call has returned. Returns
    /// the newest such edge, even if `us` has passed; `None` if there is none.
    async fn next_until(&mut self, us: u64) -> Option<DrdyEdge>;

    /// Waits until time `us`, in microseconds, and ignores DRDY.
    async fn wait_until(&mut self, us: u64);

    /// Discards all edges so far; the next wait returns only a later edge.
    fn forget(&mut self);
}
