//! The rate of a block, which determines the quantiser's step.

/// Number of rates from which an encoder chooses.
pub const RATES: usize = 16;

/// Index of the quantiser's step, 0 (finest) to 15 (coarsest). The step grows by 3 dB from one rate
/// to the next: `round(32 * 2^((rate - 4) / 2))` units of a coefficient.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Rate(u8);

impl Rate {
    /// The coarsest rate, 15.
    pub const COARSEST: Self = Self(15);

    /// The rate for which the levels of mean magnitudes are stated, 4.
    pub const MIDDLE: Self = Self(4);

    /// The quantiser's step at each rate, in units of a coefficient.
    const STEPS: [u16; RATES] =
        [8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256, 362, 512, 724, 1024, 1448];

    /// `2^34 / step`, rounded up, for each rate: multiplying by it replaces dividing by the step.
    const RECIPROCALS: [u32; RATES] = {
        let mut reciprocals = [0; RATES];
        let mut rate = 0;
        while rate < RATES {
            #[expect(clippy::cast_possible_truncation, reason = "at most 2^34 / 8")]
            let reciprocal = (1_u64 << 34).div_ceil(Self::STEPS[rate] as u64) as u32;
            reciprocals[rate] = reciprocal;
            rate += 1;
        }
        reciprocals
    };

    /// Number of levels by which each rate shifts the levels of the mean magnitudes:
    /// `round(ln(2) / 2 / LR * (4 - rate))`, where neighbouring levels have the ratio `exp(LR)`,
    /// `LR = ln(8000) / 55`.
    const LEVEL_SHIFTS: [i8; RATES] =
        [8, 6, 4, 2, 0, -2, -4, -6, -8, -11, -13, -15, -17, -19, -21, -23];

    /// Returns the rate with this index, or `None` if it is above 15.
    pub const fn new(index: u8) -> Option<Self> {
        if (index as usize) < RATES { Some(Self(index)) } else { None }
    }

    /// Returns all rates, finest first.
    pub fn all() -> impl DoubleEndedIterator<Item = Self> + Clone {
        (0..=Self::COARSEST.0).map(Self)
    }

    /// Returns the index of the rate, 0..=15.
    pub const fn index(self) -> u8 {
        self.0
    }

    /// Returns the rate that is coarser by `coarser` times 3 dB, at most [`Self::COARSEST`].
    #[must_use]
    pub fn coarser(self, coarser: u8) -> Self {
        Self(self.0.saturating_add(coarser)).min(Self::COARSEST)
    }

    /// Returns the step of the quantiser in units of a coefficient, 8..=1448.
    pub fn step(self) -> i32 {
        Self::STEPS[usize::from(self.0) % RATES].into()
    }

    /// Converts `magnitude`, below 2^17, from units of a coefficient to 1/256 of a step, rounded
    /// down. The result is below 2^22. It is exact although the reciprocal is rounded up, as a test
    /// of every magnitude and rate shows.
    pub(crate) fn in_steps(self, magnitude: u32) -> i32 {
        let reciprocal = Self::RECIPROCALS[usize::from(self.0) % RATES];
        #[expect(clippy::cast_possible_truncation, reason = "below 2^17 * 2^31 / 2^26")]
        let steps = ((u64::from(magnitude) * u64::from(reciprocal)) >> 26) as i32;
        steps
    }

    pub(crate) fn level_shift(self) -> i32 {
        Self::LEVEL_SHIFTS[usize::from(self.0) % RATES].into()
    }
}

const _: () = assert!(Rate::COARSEST.0 as usize + 1 == RATES);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_and_level_shifts_follow_their_formulas() {
        let ratio = 8000_f64.ln() / 55.0;
        for index in 0..16 {
            let rate = Rate::new(index).expect("sixteen rates");
            let coarser = f64::from(index) - 4.0;
            let step = (32.0 * (coarser / 2.0).exp2()).round();
            assert!((f64::from(rate.step()) - step).abs() < 0.5);
            let shift = (-coarser * 2_f64.ln() / 2.0 / ratio).round();
            assert!((f64::from(rate.level_shift()) - shift).abs() < 0.5);
        }
        assert_eq!(Rate::new(16), None);
    }

    #[test]
    fn magnitudes_are_divided_by_the_step_without_a_division() {
        for index in 0..16 {
            let rate = Rate::new(index).expect("sixteen rates");
            for magnitude in 0..1 << 17 {
                let exact = u64::from(magnitude) * 256 / u64::from(rate.step().cast_unsigned());
                let steps = u64::from(rate.in_steps(magnitude).cast_unsigned());
                assert_eq!(steps, exact, "{magnitude} at {index}");
            }
        }
    }
}
