//! The rate of a chain that runs.

use crate::clock::Clock;
use crate::rate::Rate;
use crate::ready::{Edge, RateError, ReadyMeter};

/// Periods without a gap by which the rate is judged: 1/8 s at 512 Hz. Stamps of 1 us tell it to 16
/// millionths then, an interrupt that is 50 us late to 400; a quartz is allowed 1000.
const PERIODS: u32 = 64;

/// Judges DRDY's edges for as long as a chain runs: an edge that is too early at once, a rate that is
/// off by less than that after [`PERIODS`] periods, and gaps as samples that nobody read.
#[derive(Clone, Debug)]
pub(crate) struct RateWatch {
    clock: Clock,
    rate: Rate,
    /// Since the last gap or early edge, at most [`PERIODS`].
    meter: ReadyMeter,
    /// What the last judgement was.
    off: Option<RateError>,
    /// The last rate that was measured, mHz.
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

    /// The last rate that was measured, mHz.
    pub(crate) const fn millihertz(&self) -> Option<u32> {
        self.measured
    }

    /// Forgets the edges so far: the next one is the first.
    pub(crate) fn restart(&mut self) {
        self.meter = ReadyMeter::new(0, self.clock, self.rate);
    }

    /// Takes an edge at a time in us, which never goes back; gives the samples that are missing before
    /// it, and why the rate is wrong.
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
    fn a_rate_that_is_a_little_off_is_flagged_until_it_is_right_again() {
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
        // 512.03 Hz are a quartz; 500 Hz are another clock.
        assert_eq!(flagged(1953, 200), 0);
        assert_eq!(flagged(2000, 128), 128 - 56);
        // Two judgements hold slow periods beside right ones.
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
