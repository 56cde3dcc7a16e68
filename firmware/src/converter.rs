//! Interface of a board's analogue-to-digital converters.

use core::future::ready;

use link::{Converters, SelfTest};
use pipeline::Sample;

/// Time and status of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conversion {
    /// Device time of the DRDY edge, microseconds since boot.
    pub drdy_us: u64,
    /// Time of the DRDY edge on the board's [`Clock`](crate::Clock), ticks.
    pub drdy_ticks: u32,
    /// Samples lost between the previous one and this one.
    pub missed: u32,
    /// Set if a status word is wrong: the counts are not to be trusted.
    pub status_bad: bool,
    /// Set if the converter reports a disconnected electrode.
    pub lead_off: bool,
}

/// Analogue-to-digital converter of a board: all channels at once.
#[expect(
    async_fn_in_trait,
    reason = "an executor of one priority polls it; it need not be Send"
)]
pub trait Converter {
    /// Waits for the next sample and writes its counts to `sample`. Counts that the converter could not
    /// deliver keep their values from the sample before.
    async fn next(&mut self, sample: &mut Sample) -> Conversion;

    /// Returns the `Converters` message for the host, or `None` if there is nothing to report.
    fn status(&self) -> Option<Converters> {
        None
    }

    /// Tests the converters with their internal test signals, which takes some seconds, and restores their
    /// settings. Calls `alive` more often than the watchdog's period.
    fn self_test(&mut self, alive: impl FnMut()) -> impl Future<Output = ()> {
        let _ = alive;
        ready(())
    }

    /// Returns the result of the last self-test, or `None` if the converters have no test signals.
    fn self_test_result(&self) -> Option<SelfTest> {
        None
    }
}
