//! One second-order filter section: direct form 1 with rounding-error feedback.

use crate::{accumulator::Accumulator, coefficient::Coefficient};

/// One second-order section: its type, which fixes the zeros exactly, and its coefficients.
///
/// In all types, feedback is added, `y0 = .. + a1 y1 + a2 y2`, so `a1` and `a2` have the opposite
/// sign of the coefficients in a denominator written `1 + a1 z^-1 + a2 z^-2`. The rounding error of
/// each output is added to the next output. `x1` and `y1` are one sample old, `x2` and `y2` two
/// samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// `y0 = x0 + x2 - y2 + a1 (y1 - x1) + (1 - b0) (2 y2 - x0 - x2)`: zeros on the unit circle,
    /// and gain exactly 1 at DC. This is `b0 x0 + b1 x1 + b2 x2 + a1 y1 + a2 y2` with `b1 = -a1`,
    /// `b2 = b0` and `a2 = 1 - 2 b0`.
    Notch {
        /// `2 b0 cos(w0)`, which sets the notch frequency `w0`.
        a1: Coefficient,
        /// `1 - b0`, which sets the width of the notch.
        one_minus_b0: Coefficient,
    },
    /// `y0 = x0 - 2 x1 + x2 + a1 y1 + a2 y2`: a double zero at DC.
    HighPass {
        /// Factor of the previous output, `y1`.
        a1: Coefficient,
        /// Factor of `y2`, the output two samples earlier.
        a2: Coefficient,
    },
    /// `y0 = gain (x0 - x2) + a1 y1 + a2 y2`: zeros at DC and at the Nyquist frequency.
    BandPass {
        /// Factor of the input term `x0 - x2`.
        gain: Coefficient,
        /// Factor of the previous output, `y1`.
        a1: Coefficient,
        /// Factor of `y2`, the output two samples earlier.
        a2: Coefficient,
    },
    /// `y0 = gain (x0 + 2 x1 + x2) + a1 y1 + a2 y2`: a double zero at the Nyquist frequency.
    LowPass {
        /// Factor of the input term `x0 + 2 x1 + x2`.
        gain: Coefficient,
        /// Factor of the previous output, `y1`.
        a1: Coefficient,
        /// Factor of `y2`, the output two samples earlier.
        a2: Coefficient,
    },
}

/// Memory of one section for one channel. The section's past inputs are not stored here, because
/// they are the past outputs of the section before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub(crate) struct SectionState {
    /// Previous output of the section.
    y1: i32,
    /// Output of this section two samples ago.
    y2: i32,
    /// Rounding error of the previous output, Q0.32 in the unit of the output, in [0, 1).
    error: u32,
}

impl SectionState {
    /// State after a long input of zeros, with the rounding error at its mean, 0.5.
    ///
    /// If the rounding error started at 0, it would step to its mean, and the high-pass sections
    /// would turn this step into a transient of up to 0.03 uV (computed for the checked-in model).
    pub(crate) const REST: Self = Self { y1: 0, y2: 0, error: 1 << 31 };
}

/// Fractions of a section's coefficients, Q0.32, in the order of the fields of [`Section`]'s
/// variant; for a variant with two coefficients, the third is 0.
pub(crate) type Fractions = [i32; 3];

impl Section {
    pub(crate) const fn fractions(&self) -> Fractions {
        match self {
            Self::Notch { a1, one_minus_b0 } => [a1.fraction, one_minus_b0.fraction, 0],
            Self::HighPass { a1, a2 } => [a1.fraction, a2.fraction, 0],
            Self::BandPass { gain, a1, a2 } | Self::LowPass { gain, a1, a2 } => {
                [gain.fraction, a1.fraction, a2.fraction]
            }
        }
    }

    /// Filters `B` consecutive samples of one channel in place.
    ///
    /// `earlier_inputs` are the two inputs before the block, `[x1, x2]`. Returns the two outputs
    /// before the block in the same order; they are the next section's `earlier_inputs`.
    ///
    /// Rounding is toward minus infinity, and the error is added to the next output (first-order
    /// noise shaping, so a constant input has no bias). Overflow wraps: the caller must prove that
    /// outputs and all multiplied numbers stay below 2^31. Intermediate sums may wrap without harm.
    ///
    /// From `self`, only the type and the integer parts are read. Where the integer parts are
    /// constants, their products become additions and shifts.
    #[inline(always)]
    pub(crate) fn apply_block<const B: usize>(
        &self,
        fractions: &Fractions,
        state: &mut SectionState,
        earlier_inputs: [i32; 2],
        block: &mut [i32; B],
    ) -> [i32; 2] {
        let earlier_outputs = [state.y1, state.y2];
        match self {
            Self::Notch { a1, one_minus_b0 } => {
                let integers = [a1.integer, one_minus_b0.integer];
                notch(integers, fractions, state, earlier_inputs, block);
            }
            Self::HighPass { a1, a2 } => {
                let integers = [a1.integer, a2.integer];
                high_pass(integers, fractions, state, earlier_inputs, block);
            }
            Self::BandPass { gain, a1, a2 } => {
                let integers = [gain.integer, a1.integer, a2.integer];
                band_pass(integers, fractions, state, earlier_inputs, block);
            }
            Self::LowPass { gain, a1, a2 } => {
                let integers = [gain.integer, a1.integer, a2.integer];
                low_pass(integers, fractions, state, earlier_inputs, block);
            }
        }
        earlier_outputs
    }
}

/// Filters with a notch by computing the change `u = y - x`:
/// `u0 = -u2 + a1 u1 + (1 - b0) (u2 + y2 - x0)`. This takes two multiplications;
/// `b0 (x0 + x2) + a1 (y1 - x1) + a2 y2` would take three. `u1` and the bracket are multiplied, so
/// both must fit 32 bits.
#[inline(always)]
fn notch<const B: usize>(
    [a1, one_minus_b0]: [i32; 2],
    fractions: &Fractions,
    state: &mut SectionState,
    [x1, x2]: [i32; 2],
    block: &mut [i32; B],
) {
    let (mut u1, mut u2) = (state.y1.wrapping_sub(x1), state.y2.wrapping_sub(x2));
    for x in block {
        let balance = state.y2.wrapping_add(u2).wrapping_sub(*x);
        let high =
            a1.wrapping_mul(u1).wrapping_sub(u2).wrapping_add(one_minus_b0.wrapping_mul(balance));
        let sum = state
            .accumulator(high)
            .multiply_add(fractions[0], u1)
            .multiply_add(fractions[1], balance);
        (u2, u1) = (u1, sum.high);
        *x = state.store_output(x.wrapping_add(sum.high), sum.low);
    }
}

/// Filters with a high-pass by computing `u = y - x`: `u0 = 2 u1 - u2 + (a1 - 2) y1 + (a2 + 1) y2`.
/// A pole pair near DC has `a1` near 2 and `a2` near -1, so the integer parts of `a1 - 2` and
/// `a2 + 1` are 0. `u` may wrap, because it is only added.
#[inline(always)]
fn high_pass<const B: usize>(
    [a1, a2]: [i32; 2],
    fractions: &Fractions,
    state: &mut SectionState,
    [x1, x2]: [i32; 2],
    block: &mut [i32; B],
) {
    let (mut u1, mut u2) = (state.y1.wrapping_sub(x1), state.y2.wrapping_sub(x2));
    for x in block {
        let high = u1
            .wrapping_add(u1)
            .wrapping_sub(u2)
            .wrapping_add((a1 - 2).wrapping_mul(state.y1))
            .wrapping_add((a2 + 1).wrapping_mul(state.y2));
        let sum = state
            .accumulator(high)
            .multiply_add(fractions[0], state.y1)
            .multiply_add(fractions[1], state.y2);
        (u2, u1) = (u1, sum.high);
        *x = state.store_output(x.wrapping_add(sum.high), sum.low);
    }
}

/// Filters with a band-pass by the formula at [`Section::BandPass`].
#[inline(always)]
fn band_pass<const B: usize>(
    [gain, a1, a2]: [i32; 3],
    fractions: &Fractions,
    state: &mut SectionState,
    [mut x1, mut x2]: [i32; 2],
    block: &mut [i32; B],
) {
    for x in block {
        let difference = x.wrapping_sub(x2);
        let high = gain
            .wrapping_mul(difference)
            .wrapping_add(a1.wrapping_mul(state.y1))
            .wrapping_add(a2.wrapping_mul(state.y2));
        let sum = state
            .accumulator(high)
            .multiply_add(fractions[0], difference)
            .multiply_add(fractions[1], state.y1)
            .multiply_add(fractions[2], state.y2);
        (x2, x1) = (x1, *x);
        *x = state.store_output(sum.high, sum.low);
    }
}

/// Filters with a low-pass by `y0 = gain (x0 + x1) + gain (x1 + x2) + a1 y1 + a2 y2`. This takes as
/// many instructions as `gain (x0 + 2 x1 + x2)`, whose bracket would need one more bit of headroom.
#[inline(always)]
fn low_pass<const B: usize>(
    [gain, a1, a2]: [i32; 3],
    fractions: &Fractions,
    state: &mut SectionState,
    [mut x1, x2]: [i32; 2],
    block: &mut [i32; B],
) {
    let mut pair1 = x1.wrapping_add(x2);
    for x in block {
        let pair0 = x.wrapping_add(x1);
        let high = gain
            .wrapping_mul(pair0.wrapping_add(pair1))
            .wrapping_add(a1.wrapping_mul(state.y1))
            .wrapping_add(a2.wrapping_mul(state.y2));
        let sum = state
            .accumulator(high)
            .multiply_add(fractions[0], pair0)
            .multiply_add(fractions[0], pair1)
            .multiply_add(fractions[1], state.y1)
            .multiply_add(fractions[2], state.y2);
        (x1, pair1) = (*x, pair0);
        *x = state.store_output(sum.high, sum.low);
    }
}

impl SectionState {
    /// Returns the accumulator for the next output: its integer part is `high`, its fraction the
    /// rounding error of the previous output.
    #[inline(always)]
    fn accumulator(&self, high: i32) -> Accumulator {
        Accumulator { high, low: self.error }
    }

    /// Stores the output `y` and its rounding error, and returns `y`.
    #[inline(always)]
    fn store_output(&mut self, y: i32, error: u32) -> i32 {
        (self.y2, self.y1, self.error) = (self.y1, y, error);
        y
    }
}
