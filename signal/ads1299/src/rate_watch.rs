//! Continuous check of DRDY's rate.

use crate::clock::Clock;
use crate::ready::{Edge, RateError, ReadyMeter};
use crate::settings::Rate;

/// Number of consecutive periods per rate check: 1/8 s at 512 Hz. Stamps of 1 us resolution measure
/// the rate over this time to 16 ppm; an interrupt delayed by 50 us adds 400 ppm. Both together
/// stay below the 1000 ppm tolerated for a quartz.
const PERIODS: u32 = 64;

/// Checks DRDY's edges while a chain converts. Reports an early edge at once, a smaller deviation
/// of the rate after [`PERIODS`] periods, and a gap as the number of samples that were not read.
#[derive(Clone, Debug)]
pub(crate) struct RateWatch {
    clock: Clock,
    rate: Rate,
    /// Measurement since the last gap or early edge, over at most [`PERIODS`] periods.
    meter: ReadyMeter,
    /// Error that the last rate check found, if any.
    off: Option<RateError>,
    /// Sample rate from the last check, in millihertz.
    measured: Option<u32>,
}

impl RateWatch {
    pub(crate) const fn new(clock: Clock, rate: Rate) -> Self {
        Self {
            clock,
            rate,
            meter: ReadyMeter::new(0, clock, rate),
            off: None,
            measured: None,
        }
    }

    /// Returns the last measured rate, in millihertz.
    pub(crate) const fn millihertz(&self) -> Option<u32> {
        self.measured
    }

    /// Discards previous edges: the next edge counts as the first.
    pub(crate) fn restart(&mut self) {
        self.meter = ReadyMeter::new(0, self.clock, self.rate);
    }

    /// Records an edge at `time_us`, which must not decrease. Returns the number of samples missing
    /// before this edge, and the error of the sample rate, if any.
    pub(crate) fn edge(&mut self, time_us: u64) -> (u32, Option<RateError>) {
        let (missed, error) = match self.meter.edge(time_us) {
            Edge::First => return (0, self.off),
            Edge::OnTime if self.meter.periods() < PERIODS => return (0, self.off),
            Edge::OnTime => {
                self.off = self.meter.check().err();
                (0, self.off)
            }
            Edge::Early => (0, self.meter.check().err()),
            Edge::Missed(missed) => (missed, self.off),
        };
        self.measured = self.meter.millihertz();
        self.restart();
        self.meter.edge(time_us);
        (missed, error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch() -> RateWatch {
        RateWatch::new(Clock::EEG, Rate::Div4096)
    }

    #[test]
    fn a_small_deviation_is_flagged_until_the_rate_is_right_again() {
        let mut watch = watch();
        let mut time_us = 0;
        let mut flagged = |period_us: u64, edges: u32| {
            (0..edges).fold(0, |flagged, _| {
                time_us += period_us;
                let (missed, error) = watch.edge(time_us);
                assert_eq!(missed, 0);
                flagged + u32::from(error.is_some())
            })
        };
        // 1953 us is 512.03 Hz, within the 1000 ppm allowed for a quartz; 2000 us is 500 Hz,
        // outside it. Of the 128 slow periods, the first 56 pass before the next rate check.
        assert_eq!(flagged(1953, 200), 0);
        assert_eq!(flagged(2000, 128), 128 - 56);
        // The rate check at the 57th edge still includes 7 slow periods. The check at the 121st
        // edge includes none, so the edges before it are flagged.
        assert_eq!(flagged(1953, 128), 120);
        assert_eq!(flagged(1953, 64), 0);
    }

    #[test]
    fn one_early_edge_is_flagged_once_and_a_gap_is_counted() {
        let mut watch = watch();
        let times = [0, 1953, 3906, 4400, 6353, 12_212, 14_165];
        let found = times.map(|time_us| watch.edge(time_us));
        let missed = found.map(|(missed, _)| missed);
        let flagged = found.map(|(_, error)| error.is_some());
        assert_eq!(missed, [0, 0, 0, 0, 0, 2, 0]);
        assert_eq!(flagged, [false, false, false, true, false, false, false]);
    }
}
