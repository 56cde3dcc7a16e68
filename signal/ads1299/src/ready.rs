//! Measurement of the sample rate from DRDY's edges.

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
    /// Less than 3/4 of a period after the previous edge: the chip is too fast, or the line is
    /// noisy.
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
        /// Number of edges that did not come.
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
        Self {
            chip,
            clock,
            rate,
            first_us: None,
            last_us: 0,
            periods: 0,
            early: 0,
            missed: 0,
        }
    }

    /// Records an edge at `time_us`, which must not decrease.
    pub fn edge(&mut self, time_us: u64) -> Edge {
        if self.first_us.is_none() {
            self.first_us = Some(time_us);
            self.last_us = time_us;
            return Edge::First;
        }
        // Intervals are in millionths of a clock cycle: exact for every rate, up to an interval of
        // three months.
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

    /// Returns the number of edges after the first one.
    pub(crate) const fn periods(&self) -> u32 {
        self.periods
    }

    /// Returns the time from the first edge to the last, in microseconds.
    fn span_us(&self) -> u64 {
        self.last_us - self.first_us.unwrap_or(self.last_us)
    }

    /// Returns the number of early edges so far.
    pub const fn early(&self) -> u32 {
        self.early
    }

    /// Returns the number of missing edges so far.
    pub const fn missed(&self) -> u32 {
        self.missed
    }

    /// Returns the mean rate in millihertz, which missing edges lower. `None` before the second
    /// edge.
    pub fn millihertz(&self) -> Option<u32> {
        let span_us = self.span_us();
        let rate = (u64::from(self.periods) * 1_000_000_000).checked_div(span_us)?;
        u32::try_from(rate).ok()
    }

    /// Checks that no edge was early or missing, and that the rate is the configured one. It may
    /// deviate by the clock's tolerance and by the resolution of two 1 us stamps, which is 16 ppm
    /// over 64 periods at 512 Hz. Returns the rate in millihertz.
    ///
    /// # Errors
    /// [`RateError`]: too few edges, a wrong rate, or early or missing edges.
    pub fn check(&self) -> Result<u32, RateError> {
        let chip = self.chip;
        let measured = self.millihertz().ok_or(RateError::NotMeasured { chip })?;
        let expected = self.rate.millihertz(self.clock);
        let stamps_ppm = 2_000_000_u64.div_ceil(self.span_us().max(1));
        let allowed = u64::from(self.clock.tolerance_ppm()) + stamps_ppm;
        let off = u64::from(measured.abs_diff(expected));
        if self.early | self.missed == 0 && off * 1_000_000 <= allowed * u64::from(expected) {
            return Ok(measured);
        }
        Err(RateError::Off {
            chip,
            measured,
            expected,
            early: self.early,
            missed: self.missed,
        })
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
            Self::Off {
                chip,
                measured,
                expected,
                early,
                missed,
            } => (chip, measured, expected, early, missed),
        };
        write!(
            formatter,
            "DRDY of ADS1299 {chip} comes at {}.{:03} Hz, and {}.{:03} Hz is set",
            measured / 1000,
            measured % 1000,
            expected / 1000,
            expected % 1000
        )?;
        // The ratio is in percent. Within 2 of 200, 300 and so on, the rate counts as a multiple of
        // the configured one.
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
            return write!(
                formatter,
                ", {early} edges come too early: look for noise on DRDY"
            );
        }
        formatter.write_str(": the clock is not the one that is set; check the quartz and CLKSEL")
    }
}

impl core::error::Error for RateError {}
