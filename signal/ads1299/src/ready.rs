//! Measures the sample rate from the edges of DRDY, and checks it while a chain converts.

use core::fmt;

use crate::clock::Clock;
use crate::settings::Rate;

/// Measures the sample rate from the times of DRDY's falling edges. The time stamps' jitter must
/// stay below a quarter of a period.
#[derive(Clone, Debug)]
pub struct ReadyMeter {
    chip: u8,
    clock: Clock,
    rate: Rate,
    first_us: Option<u64>,
    last_us: u64,
    /// Number of edges after the first one. Missing edges are not counted.
    periods: u32,
    early: u32,
    missed: u32,
}

/// Timing of an edge relative to the previous one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// The first edge: there is no previous one.
    First,
    /// From 3/4 to 1.5 periods after the previous edge.
    OnTime,
    /// Less than 3/4 of a period after the previous edge: the chip is too fast or the line noisy.
    Early,
    /// More than 1.5 periods after the previous edge; holds the number of missing edges.
    Missed(u32),
}

/// Error of the sample rate: not measured, or not the configured rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RateError {
    /// Fewer than two edges were recorded, so there is no rate.
    NotMeasured {
        /// Chip whose DRDY was measured.
        chip: u8,
    },
    /// The measured rate is not the configured one, or edges were early or missing.
    Off {
        /// Chip whose DRDY was measured.
        chip: u8,
        /// Measured rate, in millihertz.
        measured: u32,
        /// Configured rate, in millihertz.
        expected: u32,
        /// Number of edges that came less than 3/4 of a period after the previous one.
        early: u32,
        /// Number of expected edges that did not come.
        missed: u32,
    },
}

impl RateError {
    /// Returns the chip whose DRDY was measured.
    pub const fn chip(&self) -> u8 {
        match self {
            Self::NotMeasured { chip } | Self::Off { chip, .. } => *chip,
        }
    }
}

impl ReadyMeter {
    /// Creates a meter for the DRDY of `chip`, which is 0 on a board that wires only one DRDY.
    pub const fn new(chip: u8, clock: Clock, rate: Rate) -> Self {
        Self { chip, clock, rate, first_us: None, last_us: 0, periods: 0, early: 0, missed: 0 }
    }

    /// Records an edge at `time_us`, which must not decrease.
    pub fn edge(&mut self, time_us: u64) -> Edge {
        if self.first_us.is_none() {
            self.first_us = Some(time_us);
            self.last_us = time_us;
            return Edge::First;
        }
        // Intervals are in millionths of a clock cycle: exact for every rate, and without
        // saturation up to an interval of three months.
        let interval_us = time_us.saturating_sub(self.last_us);
        let interval = interval_us.saturating_mul(u64::from(self.clock.hz()));
        let period = u64::from(self.rate.divider()) * 1_000_000;
        self.last_us = self.last_us.max(time_us);
        self.periods = self.periods.saturating_add(1);
        if interval < period * 3 / 4 {
            self.early = self.early.saturating_add(1);
            return Edge::Early;
        }
        if interval <= period * 3 / 2 {
            return Edge::OnTime;
        }
        let missed = (interval - period / 2) / period;
        let missed = u32::try_from(missed).unwrap_or(u32::MAX);
        self.missed = self.missed.saturating_add(missed);
        Edge::Missed(missed)
    }

    pub(crate) const fn periods(&self) -> u32 {
        self.periods
    }

    /// Returns the time from the first edge to the last, in microseconds.
    fn span_us(&self) -> u64 {
        self.last_us - self.first_us.unwrap_or(self.last_us)
    }

    /// Returns the number of edges that came less than 3/4 of a period after the previous one.
    pub const fn early(&self) -> u32 {
        self.early
    }

    /// Returns the number of expected edges that did not come.
    pub const fn missed(&self) -> u32 {
        self.missed
    }

    /// Returns the mean rate in millihertz; missing edges lower it. `None` before the second edge.
    pub fn millihertz(&self) -> Option<u32> {
        let span_us = self.span_us();
        let rate = (u64::from(self.periods) * 1_000_000_000).checked_div(span_us)?;
        u32::try_from(rate).ok()
    }

    /// Checks that no edge was early or missing, and that the rate is the configured one within the
    /// tolerance of the chips' clock and of the clock that stamps the edges. Returns the rate in
    /// millihertz.
    ///
    /// # Errors
    /// [`RateError`]: too few edges, a wrong rate, or early or missing edges.
    pub fn check(&self) -> Result<u32, RateError> {
        self.check_within(self.clock.tolerance_ppm() + STAMPS_PPM)
    }

    /// Like [`Self::check`], but permits a deviation of `ppm` plus the resolution of two time
    /// stamps, which is 16 ppm over 64 periods at 512 Hz.
    fn check_within(&self, ppm: u32) -> Result<u32, RateError> {
        let chip = self.chip;
        let measured = self.millihertz().ok_or(RateError::NotMeasured { chip })?;
        let expected = self.rate.millihertz(self.clock);
        let stamps_ppm = 2_000_000_u64.div_ceil(self.span_us().max(1));
        let allowed = u64::from(ppm) + stamps_ppm;
        let off = u64::from(measured.abs_diff(expected));
        if self.early | self.missed == 0 && off * 1_000_000 <= allowed * u64::from(expected) {
            return Ok(measured);
        }
        Err(RateError::Off { chip, measured, expected, early: self.early, missed: self.missed })
    }
}

impl fmt::Display for RateError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (chip, measured, expected, early, missed) = match *self {
            Self::NotMeasured { chip } => {
                return write!(
                    formatter,
                    "the rate of ADS1299 {chip} was not measured: DRDY fell less than twice; check \
                     START and CLK"
                );
            }
            Self::Off { chip, measured, expected, early, missed } => {
                (chip, measured, expected, early, missed)
            }
        };
        write!(
            formatter,
            "DRDY of ADS1299 {chip} comes at {}.{:03} Hz, and {}.{:03} Hz is set",
            measured / 1000,
            measured % 1000,
            expected / 1000,
            expected % 1000
        )?;
        // The ratio is in percent. Within 2 of 200, 300 and so on, it counts as a whole multiple.
        let ratio = (u64::from(measured) * 100).div_ceil(u64::from(expected).max(1));
        if ratio >= 198 && (ratio + 2) % 100 <= 4 {
            return write!(
                formatter,
                ", {} times as fast: parts that divide the clock differently are known; check the \
                 part's marking, and CONFIG1 by reading it back",
                (ratio + 2) / 100
            );
        }
        if missed > 0 {
            return write!(
                formatter,
                ", {missed} edges are missing: look at DRDY's line and at what delays its interrupt"
            );
        }
        if early > 0 {
            return write!(formatter, ", {early} edges come too early: look for noise on DRDY");
        }
        formatter.write_str(": the clock is not the one that is set; check the quartz and CLKSEL")
    }
}

impl core::error::Error for RateError {}

/// Tolerance of the clock that stamps the edges, in ppm: an RC oscillator, as in a NUCLEO's
/// ST-LINK.
const STAMPS_PPM: u32 = 10_000;

/// Largest deviation of the rate, in ppm, that can come from the chips' clock or from the clock
/// that stamps the edges. Up to this limit the samples count as valid, and the host, which knows
/// the true time, learns the measured rate. A chip that has lost its registers deviates more: it
/// has half or twice the rate, or another ratio.
const CLOCKS_PPM: u32 = 50_000;

/// Number of consecutive periods per rate check: 1/8 s at 512 Hz. Stamps of 1 us resolution measure
/// the rate over this time to 16 ppm; an interrupt delayed by 50 us adds 400 ppm.
const PERIODS: u32 = 64;

/// Checks DRDY's edges while a chain converts. Reports an early edge at once. After every
/// [`PERIODS`] periods, reports a rate that is off by more than [`CLOCKS_PPM`]. Reports a gap as
/// the number of samples not read.
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
        Self { clock, rate, meter: ReadyMeter::new(0, clock, rate), off: None, measured: None }
    }

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
                self.off = self.meter.check_within(CLOCKS_PPM).err();
                (0, self.off)
            }
            Edge::Early => (0, self.meter.check_within(CLOCKS_PPM).err()),
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
    fn a_deviation_that_no_clock_explains_is_flagged_until_the_rate_is_right_again() {
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
        // 1953 us is 512.03 Hz, 2000 us is 500 Hz, the rate of another oscillator; 2200 us is 455
        // Hz, which no oscillator explains. Of the 128 slow periods, the first 56 pass before the
        // next rate check.
        assert_eq!(flagged(1953, 128), 0);
        assert_eq!(flagged(2000, 72), 0);
        assert_eq!(flagged(2200, 128), 128 - 56);
        // The edges up to the next rate check are still flagged.
        assert_eq!(flagged(1953, 128), 56);
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
