//! Sample rates that the chips support.

use crate::clock::Clock;

/// Sample rate, as a divider of the master clock (CONFIG1.DR, data sheet section 9.6.1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Clock / 128: 16 kHz at 2.048 MHz.
    Div128 = 0,
    /// Clock / 256: 8 kHz at 2.048 MHz.
    Div256 = 1,
    /// Clock / 512: 4 kHz at 2.048 MHz.
    Div512 = 2,
    /// Clock / 1024: 2 kHz at 2.048 MHz.
    Div1024 = 3,
    /// Clock / 2048: 1 kHz at 2.048 MHz, 1024 Hz with [`Clock::EEG`].
    Div2048 = 4,
    /// Clock / 4096: 500 Hz at 2.048 MHz, 512 Hz with [`Clock::EEG`].
    Div4096 = 5,
    /// Clock / 8192: 250 Hz at 2.048 MHz, 256 Hz with [`Clock::EEG`].
    Div8192 = 6,
}

impl Rate {
    /// Every rate, fastest first.
    pub const ALL: [Self; 7] = [
        Self::Div128,
        Self::Div256,
        Self::Div512,
        Self::Div1024,
        Self::Div2048,
        Self::Div4096,
        Self::Div8192,
    ];

    /// Returns the clock and the divider for `hz` samples per second; `None` for a rate that neither an
    /// external clock of 2.048 MHz nor [`Clock::EEG`] yields: 250, 500, 1000 .. 16000 Hz with the one,
    /// 256, 512, 1024 .. 16384 Hz with the other.
    pub const fn of_hz(hz: u32) -> Option<(Clock, Self)> {
        let mut index = 0;
        while index < Self::ALL.len() {
            let rate = Self::ALL[index];
            if rate.millihertz(Clock::EEG) == hz * 1000 {
                return Some((Clock::EEG, rate));
            }
            if rate.millihertz(Clock::DECIMAL) == hz * 1000 {
                return Some((Clock::DECIMAL, rate));
            }
            index += 1;
        }
        None
    }

    /// Returns the clock cycles between two samples.
    pub const fn divider(self) -> u32 {
        128 << self as u32
    }

    /// Returns the number of clock cycles from START to the first DRDY, at which the data are settled.
    /// The formula was neither compared with the table in data sheet section 9.4.1 nor measured.
    pub const fn settling(self) -> u32 {
        4 * self.divider() + 9
    }

    /// Returns the sample rate in millihertz, rounded down.
    #[expect(clippy::cast_possible_truncation, reason = "at most 17.6e6")]
    pub const fn millihertz(self, clock: Clock) -> u32 {
        (clock.hz() as u64 * 1000 / self.divider() as u64) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_match_the_data_sheet_and_a_quartz_for_512_hz() {
        let sheet = Rate::ALL.map(|rate| rate.millihertz(Clock::INTERNAL) / 1000);
        assert_eq!(sheet, [16_000, 8000, 4000, 2000, 1000, 500, 250]);
        assert_eq!(Rate::Div4096.millihertz(Clock::EEG), 512_000);
    }

    #[test]
    fn the_usual_rates_have_a_clock_and_a_divider() {
        for hz in [250, 256, 500, 512, 1000, 1024, 16_000, 16_384] {
            let (clock, rate) = Rate::of_hz(hz).expect("a usual rate");
            assert_eq!(rate.millihertz(clock), hz * 1000);
        }
        for hz in [0, 128, 160, 511, 600, 32_768] {
            assert_eq!(Rate::of_hz(hz), None, "{hz}");
        }
    }
}
