//! Interface of a board's analogue-to-digital converters.

use core::future::ready;

use link::{Converters, SelfTest};
use pipeline::Sample;

/// Time and status of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conversion {
    /// Device time of the DRDY edge, microseconds since boot.
    pub drdy_us: u64,
    /// Time of the sample's DRDY edge on the board's [`Clock`](crate::Clock), ticks.
    pub drdy_ticks: u32,
    /// Number of samples missed between the previous delivered sample and this one.
    pub missed: u32,
    /// Set if a converter's status word is invalid, so that the counts cannot be trusted.
    pub status_bad: bool,
    /// Set if the converter reports a disconnected electrode.
    pub lead_off: bool,
    /// Set while the current flows with which the impedance of the electrodes is measured.
    pub excited: bool,
}

/// A board's analogue-to-digital converters, which sample all channels together.
#[expect(async_fn_in_trait, reason = "an executor of one priority polls it; it need not be Send")]
pub trait Converter {
    /// Waits for the next sample and writes its counts to `sample`. Counts that the converter could
    /// not deliver keep their values from the previous sample.
    async fn next(&mut self, sample: &mut Sample) -> Conversion;

    /// Switches the excitation of the electrodes on or off between two samples. Called before every
    /// [`Self::next`]; returns at once if nothing changes or too little time is left. Does nothing
    /// by default.
    fn set_excitation(&mut self, on: bool) -> impl Future<Output = ()> {
        let _ = on;
        ready(())
    }

    /// Returns the `Converters` message for the host, or `None` if there is nothing to report.
    fn status(&self) -> Option<Converters> {
        None
    }

    /// Tests the converters with their internal test signals, which takes some seconds, and
    /// restores their settings. Calls `alive` at intervals shorter than the watchdog's period, so
    /// that the test does not count as a hang. Does nothing by default.
    fn self_test(&mut self, alive: impl FnMut()) -> impl Future<Output = ()> {
        let _ = alive;
        ready(())
    }

    /// Returns the result of the latest self-test, or `None` if the converters have no test
    /// signals.
    fn self_test_result(&self) -> Option<SelfTest> {
        None
    }
}
