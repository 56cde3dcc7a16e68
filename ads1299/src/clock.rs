//! The clock that the chips share.

/// 1 / 666 ns (7.6).
const SLOWEST_HZ: u32 = 1_501_502;

/// 1 / 444 ns (7.6).
const FASTEST_HZ: u32 = 2_252_252;

/// The clock that the chips share; everything they time counts its cycles, tCLK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    hz: u32,
    internal: bool,
}

impl Clock {
    /// A quartz of 2^21 Hz: 512 samples per second, and a test signal of 1 Hz.
    pub const EEG: Self = Self {
        hz: 1 << 21,
        internal: false,
    };

    /// Chip 0's oscillator, 2.048 MHz, given to the others at its CLK pin: chip 0 has CLKSEL high,
    /// the others low (9.3.2.2).
    pub const INTERNAL: Self = Self {
        hz: 2_048_000,
        internal: true,
    };

    /// A clock at every chip's CLK pin, Hz; none outside the range of tCLK, 444 to 666 ns (7.6).
    pub const fn external(hz: u32) -> Option<Self> {
        if hz < SLOWEST_HZ || hz > FASTEST_HZ {
            return None;
        }
        Some(Self {
            hz,
            internal: false,
        })
    }

    /// The slowest that the data sheet allows. Whoever waits for the chips waits by it: a chain whose
    /// clock is not the one that is set still answers, and [`ReadyMeter`](crate::ready::ReadyMeter) says so.
    pub(crate) const SLOWEST: Self = Self {
        hz: SLOWEST_HZ,
        internal: false,
    };

    /// Hz.
    pub const fn hz(self) -> u32 {
        self.hz
    }

    /// Whether it is chip 0's oscillator.
    pub const fn is_internal(self) -> bool {
        self.internal
    }

    /// How far the real clock may be off, in millionths. The oscillator: 2.5 % over temperature
    /// (7.5; from memory). A quartz has less than 100; the rest is
    /// for the time stamps that it is measured with.
    pub const fn tolerance_ppm(self) -> u32 {
        if self.internal { 25_000 } else { 1_000 }
    }

    /// So many cycles in ns, rounded up; cycles <= 2^22.
    pub const fn nanoseconds(self, cycles: u32) -> u64 {
        (cycles as u64 * 1_000_000_000).div_ceil(self.hz as u64)
    }

    /// So many cycles in us, rounded up; cycles <= 2^22, so less than 2.8 s.
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
