//! Gain of a channel's amplifier.

/// Internal reference voltage, in volts (data sheet section 7.5).
pub(crate) const VREF: f64 = 4.5;

/// Gain of a channel's programmable amplifier (CHnSET.GAINn, data sheet section 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gain {
    /// Gain 1: full scale is +-4.5 V.
    X1 = 0,
    /// Gain 2: full scale is +-2.25 V.
    X2 = 1,
    /// Gain 4: full scale is +-1.125 V.
    X4 = 2,
    /// Gain 6: full scale is +-750 mV.
    X6 = 3,
    /// Gain 8: full scale is +-562.5 mV.
    X8 = 4,
    /// Gain 12: full scale is +-375 mV.
    X12 = 5,
    /// Gain 24: full scale is +-187.5 mV, one count is 22.35 nV.
    X24 = 6,
}

impl Gain {
    /// Every gain, in ascending order.
    pub const ALL: [Self; 7] = [
        Self::X1,
        Self::X2,
        Self::X4,
        Self::X6,
        Self::X8,
        Self::X12,
        Self::X24,
    ];

    /// Returns the gain of a factor; `None` for a factor that the amplifier lacks.
    pub const fn of_factor(factor: u32) -> Option<Self> {
        let mut index = 0;
        while index < Self::ALL.len() {
            if Self::ALL[index].factor() as u32 == factor {
                return Some(Self::ALL[index]);
            }
            index += 1;
        }
        None
    }

    /// Returns the gain as a factor.
    pub const fn factor(self) -> u8 {
        [1, 2, 4, 6, 8, 12, 24][self as usize]
    }

    /// Returns the voltage of one count, in microvolts at the input: `2 VREF / gain / 2^24` (data
    /// sheet section 9.5.1), with the internal reference.
    #[inline]
    pub const fn lsb_uv(self) -> f64 {
        VREF * 1e6 / (self.factor() as f64) / 8_388_608.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_gain_is_found_by_its_factor() {
        for gain in Gain::ALL {
            assert_eq!(Gain::of_factor(gain.factor().into()), Some(gain));
        }
        assert_eq!([0, 3, 7, 25, 257].map(Gain::of_factor), [None; 5]);
    }

    #[test]
    fn one_count_at_gain_24_is_22_nanovolts() {
        assert!((Gain::X24.lsb_uv() - 22.351_741_790_771_484e-3).abs() < 1e-15);
    }
}
