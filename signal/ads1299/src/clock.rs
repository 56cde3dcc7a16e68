//! Master clock of the ADS1299 chips.

/// Master clock, which all chips of a chain share. All times of the chips are multiples of the
/// clock's period, tCLK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    hz: u32,
    tolerance_ppm: u32,
}

impl Clock {
    /// 2^21 Hz, for 512 samples per second and a test signal of 1 Hz.
    pub const EEG: Self = Self::crystal(1 << 21);

    /// 2.048 MHz, for 250, 500 or 1000 samples per second.
    pub const DECIMAL: Self = Self::crystal(2_048_000);

    /// Oscillator inside a chip (CLKSEL high), 2.048 MHz within 2.5 % from -40 to 85 degC, and
    /// within 0.5 % at 25 degC (data sheet section 7.5).
    pub const INTERNAL: Self = Self { hz: 2_048_000, tolerance_ppm: 25_000 };

    /// Slowest clock that the data sheet permits: a period of 666 ns (section 7.6). The driver
    /// computes its delays for this clock, so they are long enough for any permitted clock. A chain
    /// whose clock differs from the configured clock therefore still answers, and
    /// [`ReadyMeter`](crate::ready::ReadyMeter) reports the wrong rate.
    pub(crate) const SLOWEST: Self = Self::crystal(1_501_502);

    const fn crystal(hz: u32) -> Self {
        let tolerance_ppm = 100;
        Self { hz, tolerance_ppm }
    }

    /// Returns the frequency of the master clock, in Hz.
    pub const fn hz(self) -> u32 {
        self.hz
    }

    /// Returns the largest deviation from [`Self::hz`], in ppm.
    pub const fn tolerance_ppm(self) -> u32 {
        self.tolerance_ppm
    }

    /// Returns the duration of `cycles` in nanoseconds, rounded up; `cycles <= 2^22`.
    pub const fn nanoseconds(self, cycles: u32) -> u64 {
        (cycles as u64 * 1_000_000_000).div_ceil(self.hz as u64)
    }

    /// Returns the duration of `cycles` in microseconds, rounded up; `cycles <= 2^22` (< 2.8 s).
    #[expect(clippy::cast_possible_truncation, reason = "less than 2.8e6")]
    pub const fn microseconds(self, cycles: u32) -> u32 {
        self.nanoseconds(cycles).div_ceil(1000) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_is_rounded_up() {
        assert_eq!(Clock::EEG.microseconds(1 << 18), 125_000);
        assert_eq!(Clock::EEG.nanoseconds(4), 1908);
        assert_eq!(Clock::EEG.microseconds(4), 2);
    }
}
