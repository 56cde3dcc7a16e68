//! The context of a coefficient in the probability model: how large the coefficient's magnitude is
//! expected to be. The context chooses the table of probabilities that codes the magnitude.

use crate::quantiser::{Magnitude, State};
use crate::rate::Rate;
use crate::tables::{ESCAPE, LEVELS};

/// Largest level on the logarithmic scale of expected magnitudes.
const LAST_LEVEL: i32 = 63;

/// Amount that a magnitude of 1 adds to the [`Activity`].
const ONE: u32 = 1024;

/// Each coefficient first reduces the [`Activity`] by 1 / 2^5 of the activity.
const DECAY_BITS: u32 = 5;

/// Sum of the magnitudes of a block's earlier coefficients, in which older coefficients count less;
/// below 2^19. If the activity is above the expected activity, tables for larger magnitudes are
/// used, so that probabilities adapt to a loud block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Activity(u32);

impl Activity {
    /// Activity before the first coefficient of a block: the value that the activity approaches if
    /// magnitudes are 1/4 on average.
    pub(crate) const START: Self = Self(8 * ONE);

    /// Returns the activity after a coefficient with this magnitude.
    #[inline(always)]
    pub(crate) fn after(self, magnitude: u32) -> Self {
        Self(self.0 - (self.0 >> DECAY_BITS) + ONE * magnitude.min(ESCAPE.into()))
    }
}

/// What is expected of one coefficient at one rate before the block's magnitudes are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Context {
    /// Expected magnitude as a level of a logarithmic scale, 0..[`LEVELS`].
    level: u8,
    /// 2^35 divided by the expected activity; multiplication by this number replaces a division.
    inverse: u32,
}

impl Context {
    /// Initial value of a context that [`prepare`] will overwrite.
    pub const EMPTY: Self = Self { level: 0, inverse: 0 };

    /// Returns the level, 0..[`LEVELS`], whose table codes the coefficient: the expected level plus
    /// an offset for the ratio of actual to expected activity.
    #[inline(always)]
    pub(crate) fn table_level(self, activity: Activity) -> usize {
        let eighths = (u64::from(activity.0) * u64::from(self.inverse)) >> 32;
        let eighths = (eighths as i32).clamp(0, 63).cast_unsigned() as usize;
        let moved = i32::from(self.level) + i32::from(LEVEL_OF_RATIO[eighths]);
        moved.clamp(0, LAST_LEVEL).cast_unsigned() as usize
    }
}

/// Writes the contexts of a block's coefficients for a rate.
///
/// `levels` are the trained levels of the mean magnitudes at rate 4, 0..[`LEVELS`]. If the slices
/// differ in length, the rest of the longer slice is ignored.
pub fn prepare(levels: &[u8], rate: Rate, contexts: &mut [Context]) {
    // `expected` is the expected activity times 16.
    let mut expected = Activity::START.0 << 4;
    for (&level, context) in levels.iter().zip(contexts) {
        let level = (i32::from(level) + rate.level_shift()).clamp(0, LAST_LEVEL);
        #[expect(clippy::cast_possible_truncation, reason = "below 64")]
        let level = level.cast_unsigned() as u8;
        *context = Context { level, inverse: inverse(expected) };
        let mean = EXPECTED_STEP[usize::from(level) % LEVELS];
        expected = expected - (expected >> DECAY_BITS) + mean;
    }
}

/// Returns `2^39 / expected` within 0.5 %, from a table indexed by the leading 8 bits of
/// `expected`, which must be in 2^8..2^23.
fn inverse(expected: u32) -> u32 {
    let zeros = expected.leading_zeros().clamp(9, 23);
    let leading = (expected << zeros) >> 24;
    u32::from(RECIPROCALS[leading as usize % 128]) << (zeros - 8)
}

/// `2^23 / (leading + 1/2)` for all values of the leading 8 bits, 128..256.
const RECIPROCALS: [u16; 128] = {
    let mut reciprocals = [0; 128];
    let mut index = 0;
    while index < 128 {
        #[expect(clippy::cast_possible_truncation, reason = "at most 2^24 / 257")]
        let reciprocal = ((1_u32 << 24) / (2 * (index as u32 + 128) + 1)) as u16;
        reciprocals[index] = reciprocal;
        index += 1;
    }
    reciprocals
};

/// Offset of the level for each ratio of actual to expected activity:
/// `round(0.55 * ln((i + 1/2) / 8) / LR)`, where `i` is eight times the ratio, rounded down, and
/// `LR = ln(8000) / 55`.
const LEVEL_OF_RATIO: [i8; 64] = [
    -9, -6, -4, -3, -2, -1, -1, 0, 0, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4,
    4, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 6, 7, 7, 7, 7, 7, 7,
    7, 7, 7,
];

/// Amount, times 16, that a coefficient of each level is expected to add to the activity:
/// `round(1024 * 16 * mean)` with the level's mean magnitude `0.0015 * exp(LR * level)`, at most
/// 15, and `LR = ln(8000) / 55`. The mean of level 55 is 12.
const EXPECTED_STEP: [u32; LEVELS] = [
    25, 29, 34, 40, 47, 56, 66, 77, 91, 107, 126, 148, 175, 206, 242, 285, 336, 395, 465, 548, 645,
    760, 895, 1054, 1241, 1461, 1720, 2026, 2385, 2809, 3307, 3894, 4586, 5400, 6358, 7487, 8816,
    10381, 12223, 14393, 16948, 19957, 23499, 27671, 32582, 38366, 45177, 53196, 62639, 73758,
    86851, 102_268, 120_422, 141_798, 166_969, 196_608, 231_508, 245_760, 245_760, 245_760,
    245_760, 245_760, 245_760, 245_760,
];

const _: () = assert!(LAST_LEVEL as usize + 1 == LEVELS);

/// A magnitude and the table of probabilities that codes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Quantiser whose table is used, 0 or 1.
    pub quantiser: usize,
    /// Level whose table is used, 0..64.
    pub level: usize,
    /// The magnitude that is coded.
    pub magnitude: Magnitude,
}

/// Returns each magnitude of a block with the quantiser and level whose table codes it. Training
/// counts these symbols to compute the tables.
pub fn symbols<'b>(
    magnitudes: &'b [Magnitude],
    contexts: &'b [Context],
) -> impl Iterator<Item = Symbol> + 'b {
    let mut place = Place::START;
    magnitudes.iter().zip(contexts).map(move |(&magnitude, context)| {
        let symbol =
            Symbol { quantiser: place.quantiser(), level: place.level(*context), magnitude };
        place.advance(magnitude);
        symbol
    })
}

/// What encoder and decoder derive from a block's earlier magnitudes: state of the quantiser and
/// activity. With a context, they determine the table for the next magnitude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    state: State,
    activity: Activity,
}

impl Place {
    /// State and activity before the first coefficient of a block.
    pub(crate) const START: Self = Self { state: State::START, activity: Activity::START };

    /// Returns the quantiser of the next coefficient, 0 or 1.
    #[inline(always)]
    pub(crate) fn quantiser(self) -> usize {
        self.state.quantiser() % 2
    }

    /// Returns the level of the next coefficient's table.
    #[inline(always)]
    pub(crate) fn level(self, context: Context) -> usize {
        context.table_level(self.activity)
    }

    /// Advances past the current coefficient, whose magnitude is `magnitude`.
    #[inline(always)]
    pub(crate) fn advance(&mut self, magnitude: Magnitude) {
        self.activity = self.activity.after(magnitude.value.into());
        self.state = self.state.after(magnitude.value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_follow_their_formulas() {
        let ratio = 8000_f64.ln() / 55.0;
        for (level, &step) in (0..).zip(&EXPECTED_STEP) {
            let mean = 0.0015 * (ratio * f64::from(level)).exp();
            let mean = mean.min(15.0);
            assert!((f64::from(step) - (1024.0 * 16.0 * mean).round()).abs() < 0.5);
        }
        for (eighths, &moved) in (0..).zip(&LEVEL_OF_RATIO) {
            let exact = (0.55 * ((f64::from(eighths) + 0.5) / 8.0).ln() / ratio).round();
            assert!((f64::from(moved) - exact).abs() < 0.5);
        }
    }

    #[test]
    fn an_inverse_is_within_half_a_percent() {
        for expected in (256..1 << 23).step_by(37) {
            let exact = 2_f64.powi(39) / f64::from(expected);
            let error = (f64::from(inverse(expected)) - exact).abs();
            assert!(error <= exact * 0.005, "{expected}");
        }
    }

    #[test]
    fn activities_stay_in_their_range() {
        let (mut most, mut least) = (Activity::START, Activity::START);
        for _ in 0..1000 {
            (most, least) = (most.after(u32::MAX), least.after(0));
        }
        assert!(most.0 < 1 << 19 && least.0 < ONE / 16, "{most:?} {least:?}");
        // The expected activity times 16 is at least 32 times the step of the lowest level and at
        // most 32 times the step of the highest level. Both are in the range of `inverse`.
        assert!(32 * EXPECTED_STEP[0] > 256 && 32 * EXPECTED_STEP[LEVELS - 1] < 1 << 23);
    }

    #[test]
    fn a_loud_block_uses_tables_of_larger_magnitudes() {
        let mut contexts = [Context::EMPTY; 40];
        prepare(&[30; 40], Rate::new(4).expect("a rate"), &mut contexts);
        let (mut loud, mut quiet) = (Activity::START, Activity::START);
        for context in contexts {
            assert!(context.table_level(quiet) <= context.table_level(loud));
            (loud, quiet) = (loud.after(3), quiet.after(0));
        }
        let last = contexts[39];
        assert!(last.table_level(quiet) < last.table_level(loud));
    }
}
