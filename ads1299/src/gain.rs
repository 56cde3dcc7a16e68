//! The amplifier before the converter.

/// The reference, V: the internal one (7.5).
pub(crate) const VREF: f64 = 4.5;

/// Gain of a channel's amplifier (CHnSET.GAINn, 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gain {
    /// 1: full scale is +-4.5 V.
    X1 = 0,
    /// 2.
    X2 = 1,
    /// 4.
    X4 = 2,
    /// 6.
    X6 = 3,
    /// 8.
    X8 = 4,
    /// 12.
    X12 = 5,
    /// 24: full scale is +-187.5 mV, a count 22.35 nV.
    X24 = 6,
}

impl Gain {
    /// Every gain, the smallest first.
    pub const ALL: [Self; 7] = [
        Self::X1,
        Self::X2,
        Self::X4,
        Self::X6,
        Self::X8,
        Self::X12,
        Self::X24,
    ];

    /// As a factor.
    pub const fn factor(self) -> u8 {
        [1, 2, 4, 6, 8, 12, 24][self as usize]
    }

    /// One count at the input, uV: `2 VREF / gain / 2^24` (9.5.1) with the internal reference.
    #[inline]
    pub const fn lsb_uv(self) -> f64 {
        VREF * 1e6 / (self.factor() as f64) / 8_388_608.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_at_gain_24_is_what_the_model_calls_one() {
        assert!((Gain::X24.lsb_uv() - 22.351_741_790_771_484e-3).abs() < 1e-15);
    }
}
