//! What a board has to give: samples.

use core::future::ready;

use link::{Converters, SelfTest};
use pipeline::Sample;

/// One reading of the converter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conversion {
    /// Device time of the DRDY edge, microseconds since boot.
    pub drdy_us: u64,
    /// The same edge on the board's [`Clock`](crate::Clock), ticks.
    pub drdy_ticks: u32,
    /// Samples before this one that came and were not read.
    pub missed: u32,
    /// A status word was wrong: the counts are not to be trusted.
    pub status_bad: bool,
    /// The converter reports an electrode off.
    pub lead_off: bool,
}

/// The analogue-to-digital converter of a board.
#[expect(
    async_fn_in_trait,
    reason = "an executor of one priority polls it; it need not be Send"
)]
pub trait Converter {
    /// Waits for the next sample and writes it down; the same counts as before where the converter
    /// gave nothing that can be read.
    async fn next(&mut self, sample: &mut Sample) -> Conversion;

    /// How the converters are, for the host; none where there is nothing to tell.
    fn state(&self) -> Option<Converters> {
        None
    }

    /// Tries the converters with their own signals, some seconds long, and brings them back to where
    /// they were; shows more often than the watchdog waits that it is alive.
    fn self_test(&mut self, alive: impl FnMut()) -> impl Future<Output = ()> {
        let _ = alive;
        ready(())
    }

    /// What the last self-test has found, for the host; none where the converters have no signals of
    /// their own.
    fn tested(&self) -> Option<SelfTest> {
        None
    }
}
