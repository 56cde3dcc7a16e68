//! What the times of DRDY's edges say.

use core::fmt;

use crate::clock::Clock;
use crate::rate::Rate;

/// Judges the rate of samples by the times of DRDY's falling edges. Time stamps may jitter by less
/// than a quarter of a period.
#[derive(Clone, Debug)]
pub struct ReadyMeter {
    chip: u8,
    clock: Clock,
    rate: Rate,
    first_us: Option<u64>,
    last_us: u64,
    /// Edges after the first one.
    periods: u32,
    early: u32,
    missed: u32,
}

/// How an edge came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// The first one: nothing to hold it against.
    First,
    /// A period after the one before.
    OnTime,
    /// Less than three quarters of a period after it: the chip is too fast, or noise is on the line.
    Early,
    /// More than one and a half periods after it: so many edges are missing in between.
    Missed(u32),
}

/// Why the rate of samples is not what was set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RateError {
    /// Fewer than two edges.
    NotMeasured {
        /// The chip whose DRDY it is.
        chip: u8,
    },
    /// It is off.
    Off {
        /// The chip whose DRDY it is.
        chip: u8,
        /// Measured, mHz.
        measured: u32,
        /// Set, mHz.
        expected: u32,
        /// Edges that came too early.
        early: u32,
        /// Edges that are missing.
        missed: u32,
    },
}

impl RateError {
    /// The chip whose DRDY it is.
    pub const fn chip(&self) -> u8 {
        match self {
            Self::NotMeasured { chip } | Self::Off { chip, .. } => *chip,
        }
    }
}

impl ReadyMeter {
    /// Before the first edge of a chip's DRDY; if only one is wired, that of chip 0.
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

    /// Takes an edge at a time in us, which never goes back.
    pub fn edge(&mut self, time_us: u64) -> Edge {
        if self.first_us.is_none() {
            self.first_us = Some(time_us);
            self.last_us = time_us;
            return Edge::First;
        }
        // In millionths of a cycle: exact for every rate, up to three months between two edges.
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

    /// Edges so far after the first one.
    pub(crate) const fn periods(&self) -> u32 {
        self.periods
    }

    /// From the first edge to the last, us.
    fn span_us(&self) -> u64 {
        self.last_us - self.first_us.unwrap_or(self.last_us)
    }

    /// Edges so far that came too early.
    pub const fn early(&self) -> u32 {
        self.early
    }

    /// Edges so far that are missing.
    pub const fn missed(&self) -> u32 {
        self.missed
    }

    /// The rate, mHz; missing edges lower it. None before the second edge.
    pub fn millihertz(&self) -> Option<u32> {
        let span_us = self.span_us();
        let rate = (u64::from(self.periods) * 1_000_000_000).checked_div(span_us)?;
        u32::try_from(rate).ok()
    }

    /// Whether the rate is what was set, as far as the clock and two stamps of 1 us can tell, and no
    /// edge came too early or is missing.
    ///
    /// # Errors
    /// [`RateError`]; 64 edges at 512 Hz tell the rate to 16 millionths.
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
        // A ratio within 2 % of a whole number.
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
