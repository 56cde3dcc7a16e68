//! Master clock of the chips.

/// Slowest permitted clock in Hz: 1 / 666 ns (data sheet section 7.6).
const SLOWEST_HZ: u32 = 1_501_502;

/// Fastest permitted clock in Hz: 1 / 444 ns (data sheet section 7.6).
const FASTEST_HZ: u32 = 2_252_252;

/// Master clock, shared by the chips. All times of the chips are multiples of the clock's period,
/// tCLK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    hz: u32,
    internal: bool,
}

impl Clock {
    /// External clock of 2^21 Hz, for 512 samples per second and a test signal of 1 Hz.
    pub const EEG: Self = Self {
        hz: 1 << 21,
        internal: false,
    };

    /// External clock of 2.048 MHz, for 250, 500 or 1000 samples per second.
    pub const DECIMAL: Self = Self {
        hz: 2_048_000,
        internal: false,
    };

    /// Internal oscillator of chip 0, 2.048 MHz. Chip 0 has CLKSEL high and drives the other chips
    /// from its CLK pin; they have CLKSEL low (data sheet section 9.3.2.2).
    pub const INTERNAL: Self = Self {
        hz: 2_048_000,
        internal: true,
    };

    /// Returns an external clock of `hz` at every CLK pin; `None` if tCLK is outside 444 to 666 ns
    /// (data sheet section 7.6).
    pub const fn external(hz: u32) -> Option<Self> {
        if hz < SLOWEST_HZ || hz > FASTEST_HZ {
            return None;
        }
        Some(Self {
            hz,
            internal: false,
        })
    }

    /// Slowest clock that the data sheet permits. The driver computes its delays for this clock, so
    /// they are long enough for any permitted clock. A chain with another clock than the configured
    /// one therefore answers, and [`ReadyMeter`](crate::ready::ReadyMeter) reports the wrong rate.
    pub(crate) const SLOWEST: Self = Self {
        hz: SLOWEST_HZ,
        internal: false,
    };

    /// Returns the frequency in Hz.
    pub const fn hz(self) -> u32 {
        self.hz
    }

    /// Returns whether the clock is chip 0's internal oscillator.
    pub const fn is_internal(self) -> bool {
        self.internal
    }

    /// Returns the accepted deviation of the measured sample rate from the configured one, in ppm.
    /// For the internal oscillator that is an assumed accuracy of 2.5 % over temperature, which was
    /// not compared with the data sheet (section 7.5). A quartz is within 100 ppm; the other 900
    /// ppm allow for the clock that stamps the edges of DRDY.
    pub const fn tolerance_ppm(self) -> u32 {
        if self.internal { 25_000 } else { 1_000 }
    }

    /// Returns the duration of `cycles` in nanoseconds, rounded up; `cycles <= 2^22`.
    pub const fn nanoseconds(self, cycles: u32) -> u64 {
        (cycles as u64 * 1_000_000_000).div_ceil(self.hz as u64)
    }

    /// Returns the duration of `cycles` in microseconds, rounded up; `cycles <= 2^22`, so below 2.8
    /// s.
    #[expect(clippy::cast_possible_truncation, reason = "less than 2.8e6")]
    pub const fn microseconds(self, cycles: u32) -> u32 {
        self.nanoseconds(cycles).div_ceil(1000) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_outside_the_data_sheet_are_refused() {
        assert_eq!(Clock::external(1 << 21), Some(Clock::EEG));
        assert_eq!(Clock::external(1_500_000), None);
        assert_eq!(Clock::external(4_096_000), None);
    }

    #[test]
    fn a_wait_is_rounded_up() {
        assert_eq!(Clock::EEG.microseconds(1 << 18), 125_000);
        assert_eq!(Clock::EEG.nanoseconds(4), 1908);
        assert_eq!(Clock::EEG.microseconds(4), 2);
    }
}
