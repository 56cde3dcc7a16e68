//! One second-order section, direct form 1 with the rounding error carried.

use crate::Coefficient;

/// Which numerator a section has; the zeros are exact, whatever the coefficients round to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// `gain (x0 + x2) + first (x1 - y1) + second y2`: zeros on the unit circle, gain 1 at DC
    /// exactly when `second = 1 - 2 gain`.
    Notch,
    /// `gain (x0 - 2 x1 + x2) + first y1 + second y2`: a double zero at DC.
    HighPass,
    /// `gain (x0 - x2) + first y1 + second y2`: zeros at DC and at the Nyquist frequency.
    BandPass,
    /// `gain (x0 + 2 x1 + x2) + first y1 + second y2`: a double zero at the Nyquist frequency.
    LowPass,
}

/// Configuration of one section: the next output is the shape's formula plus the error that the
/// previous output left over.
///
/// In the usual notation `first = -a1` and `second = -a2` (notch: `first = b1 = a1`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// Numerator.
    pub shape: Shape,
    /// Factor of the numerator.
    pub gain: Coefficient,
    /// Factor of the previous output (notch: of previous input minus previous output).
    pub first: Coefficient,
    /// Factor of the output before that.
    pub second: Coefficient,
}

/// What one section remembers of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SectionState {
    /// Previous output.
    pub(crate) y1: i32,
    /// The output before that.
    pub(crate) y2: i32,
    /// Rounding error of the previous output, Q0.32 of one output step, in [0, 1).
    pub(crate) error: u32,
}

impl SectionState {
    /// The state at rest: all inputs and outputs so far were zero. The error starts at its mean of
    /// a half: from 0, the rounding of every start would be a step of half an output step, which
    /// the high-pass sections turn into 0.06 uV over the first 0.3 s.
    pub const REST: Self = Self {
        y1: 0,
        y2: 0,
        error: 1 << 31,
    };
}

impl Default for SectionState {
    fn default() -> Self {
        Self::REST
    }
}

impl Section {
    /// The next output; `x1` and `x2` are the inputs before `x0`.
    ///
    /// Rounding: toward minus infinity, the error carried into the next output (first-order noise
    /// shaping, so a constant leaves no bias). Overflow: wraps; |output| < 2^31 is the caller's
    /// proof, intermediate sums may wrap without harm.
    #[inline]
    pub fn step(&self, state: &mut SectionState, x0: i32, x1: i32, x2: i32) -> i32 {
        let (input, recent) = match self.shape {
            Shape::Notch => (x0.wrapping_add(x2), x1.wrapping_sub(state.y1)),
            Shape::HighPass => (
                x0.wrapping_sub(x1).wrapping_sub(x1).wrapping_add(x2),
                state.y1,
            ),
            Shape::BandPass => (x0.wrapping_sub(x2), state.y1),
            Shape::LowPass => (
                x0.wrapping_add(x1).wrapping_add(x1).wrapping_add(x2),
                state.y1,
            ),
        };
        let mut sum = i64::from(state.error);
        sum = self.gain.multiply_add(sum, input);
        sum = self.first.multiply_add(sum, recent);
        sum = self.second.multiply_add(sum, state.y2);
        let (y, error) = split(sum);
        *state = SectionState {
            y1: y,
            y2: state.y1,
            error,
        };
        y
    }

    /// The two latest outputs of `state`: the inputs before the current one of the next section.
    #[inline]
    pub(crate) fn outputs(state: &SectionState) -> (i32, i32) {
        (state.y1, state.y2)
    }
}

/// High word and low word: the output, and the error that it leaves.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the two halves of a 64-bit word"
)]
fn split(sum: i64) -> (i32, u32) {
    ((sum >> 32) as i32, sum as u32)
}
