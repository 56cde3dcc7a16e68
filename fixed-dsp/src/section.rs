//! One second-order section, direct form 1 with the rounding error carried.

use crate::{Coefficient, accumulator::Accumulator};

/// Configuration of one section: a shape, whose zeros are exact whatever the coefficients round to,
/// and its coefficients. The next output is the shape's formula plus the error that the previous
/// output left over.
///
/// In the usual notation `first = -a1` and `second = -a2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// `x0 + x2 - y2 + turn (y1 - x1) + loss (2 y2 - x0 - x2)`: zeros on the unit circle, and gain
    /// exactly 1 at DC.
    ///
    /// In the usual notation `loss = 1 - b0` and `turn = -a1 = -b1`.
    Notch {
        /// `2 b0 cos(w0)`: where the notch lies.
        turn: Coefficient,
        /// What it takes from the signal on either side: its width.
        loss: Coefficient,
    },
    /// `x0 - 2 x1 + x2 + first y1 + second y2`: a double zero at DC.
    HighPass {
        /// Factor of the previous output.
        first: Coefficient,
        /// Factor of the output before that.
        second: Coefficient,
    },
    /// `gain (x0 - x2) + first y1 + second y2`: zeros at DC and at the Nyquist frequency.
    BandPass {
        /// Factor of the numerator.
        gain: Coefficient,
        /// Factor of the previous output.
        first: Coefficient,
        /// Factor of the output before that.
        second: Coefficient,
    },
    /// `gain (x0 + 2 x1 + x2) + first y1 + second y2`: a double zero at the Nyquist frequency.
    LowPass {
        /// Factor of the numerator.
        gain: Coefficient,
        /// Factor of the previous output.
        first: Coefficient,
        /// Factor of the output before that.
        second: Coefficient,
    },
}

/// What one section remembers of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct SectionState {
    /// Previous output.
    y1: i32,
    /// The output before that.
    y2: i32,
    /// Rounding error of the previous output, Q0.32 of one output step, in [0, 1).
    error: u32,
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

/// The rest of each coefficient below its integer, Q0.32, in the order of the shape's fields.
pub(crate) type Remainders = [i32; 3];

impl Section {
    /// What the compiler does not know of a section whose shape and integers it knows.
    pub(crate) const fn remainders(&self) -> Remainders {
        match self {
            Self::Notch { turn, loss } => [turn.remainder, loss.remainder, 0],
            Self::HighPass { first, second } => [first.remainder, second.remainder, 0],
            Self::BandPass {
                gain,
                first,
                second,
            }
            | Self::LowPass {
                gain,
                first,
                second,
            } => [gain.remainder, first.remainder, second.remainder],
        }
    }

    /// Filters consecutive samples of one channel in place.
    ///
    /// Rounding: toward minus infinity, the error carried into the next output (first-order noise
    /// shaping, so a constant leaves no bias). Overflow: wraps; |output| < 2^31 is the caller's
    /// proof, intermediate sums may wrap without harm.
    ///
    /// `before` are the two inputs before the block, the later one first; gives the two outputs
    /// before it in the same order: the next section's `before`.
    ///
    /// Only the integers and the shape are read from `self`. Where they are constants, their
    /// products become additions and shifts.
    #[inline(always)]
    pub(crate) fn block<const B: usize>(
        &self,
        remainders: &Remainders,
        state: &mut SectionState,
        before: [i32; 2],
        block: &mut [i32; B],
    ) -> [i32; 2] {
        let outputs = [state.y1, state.y2];
        match self {
            Self::Notch { turn, loss } => {
                let integers = [turn.integer, loss.integer];
                notch(integers, remainders, state, before, block);
            }
            Self::HighPass { first, second } => {
                let integers = [first.integer, second.integer];
                high_pass(integers, remainders, state, before, block);
            }
            Self::BandPass {
                gain,
                first,
                second,
            } => {
                let integers = [gain.integer, first.integer, second.integer];
                band_pass(integers, remainders, state, before, block);
            }
            Self::LowPass {
                gain,
                first,
                second,
            } => {
                let integers = [gain.integer, first.integer, second.integer];
                low_pass(integers, remainders, state, before, block);
            }
        }
        outputs
    }
}

/// A notch in terms of `u = y - x`, what it changes: `u0 = -u2 + turn u1 + loss (u2 + y2 - x0)`, two
/// multiplications instead of the textbook's four. `u0` may wrap where it is only added.
#[inline(always)]
fn notch<const B: usize>(
    [turn, loss]: [i32; 2],
    remainders: &Remainders,
    state: &mut SectionState,
    [x1, x2]: [i32; 2],
    block: &mut [i32; B],
) {
    let (mut u1, mut u2) = (state.y1.wrapping_sub(x1), state.y2.wrapping_sub(x2));
    for x in block {
        let balance = state.y2.wrapping_add(u2).wrapping_sub(*x);
        let high = turn
            .wrapping_mul(u1)
            .wrapping_sub(u2)
            .wrapping_add(loss.wrapping_mul(balance));
        let sum = state
            .sum(high)
            .multiply_add(remainders[0], u1)
            .multiply_add(remainders[1], balance);
        (u2, u1) = (u1, sum.high);
        *x = state.output(x.wrapping_add(sum.high), sum.low);
    }
}

/// A high-pass in the same terms: `u0 = 2 u1 - u2 + (first - 2) y1 + (second + 1) y2`. A pole pair
/// near DC has `first` near 2 and `second` near -1, so both integers vanish.
#[inline(always)]
fn high_pass<const B: usize>(
    [first, second]: [i32; 2],
    remainders: &Remainders,
    state: &mut SectionState,
    [x1, x2]: [i32; 2],
    block: &mut [i32; B],
) {
    let (mut u1, mut u2) = (state.y1.wrapping_sub(x1), state.y2.wrapping_sub(x2));
    for x in block {
        let high = u1
            .wrapping_add(u1)
            .wrapping_sub(u2)
            .wrapping_add((first - 2).wrapping_mul(state.y1))
            .wrapping_add((second + 1).wrapping_mul(state.y2));
        let sum = state
            .sum(high)
            .multiply_add(remainders[0], state.y1)
            .multiply_add(remainders[1], state.y2);
        (u2, u1) = (u1, sum.high);
        *x = state.output(x.wrapping_add(sum.high), sum.low);
    }
}

/// `gain (x0 - x2) + first y1 + second y2`.
#[inline(always)]
fn band_pass<const B: usize>(
    [gain, first, second]: [i32; 3],
    remainders: &Remainders,
    state: &mut SectionState,
    [mut x1, mut x2]: [i32; 2],
    block: &mut [i32; B],
) {
    for x in block {
        let change = x.wrapping_sub(x2);
        let high = gain
            .wrapping_mul(change)
            .wrapping_add(first.wrapping_mul(state.y1))
            .wrapping_add(second.wrapping_mul(state.y2));
        let sum = state
            .sum(high)
            .multiply_add(remainders[0], change)
            .multiply_add(remainders[1], state.y1)
            .multiply_add(remainders[2], state.y2);
        (x2, x1) = (x1, *x);
        *x = state.output(sum.high, sum.low);
    }
}

/// `gain (x0 + x1) + gain (x1 + x2) + first y1 + second y2`: as many instructions as with one sum of
/// three inputs, which would need another bit of head room.
#[inline(always)]
fn low_pass<const B: usize>(
    [gain, first, second]: [i32; 3],
    remainders: &Remainders,
    state: &mut SectionState,
    [mut x1, x2]: [i32; 2],
    block: &mut [i32; B],
) {
    let mut pair1 = x1.wrapping_add(x2);
    for x in block {
        let pair0 = x.wrapping_add(x1);
        let high = gain
            .wrapping_mul(pair0.wrapping_add(pair1))
            .wrapping_add(first.wrapping_mul(state.y1))
            .wrapping_add(second.wrapping_mul(state.y2));
        let sum = state
            .sum(high)
            .multiply_add(remainders[0], pair0)
            .multiply_add(remainders[0], pair1)
            .multiply_add(remainders[1], state.y1)
            .multiply_add(remainders[2], state.y2);
        (x1, pair1) = (*x, pair0);
        *x = state.output(sum.high, sum.low);
    }
}

impl SectionState {
    /// The sum of the next output so far: whole steps, and the error left over.
    #[inline(always)]
    fn sum(&self, high: i32) -> Accumulator {
        Accumulator {
            high,
            low: self.error,
        }
    }

    /// Remembers the next output and its error.
    #[inline(always)]
    fn output(&mut self, y: i32, error: u32) -> i32 {
        (self.y2, self.y1, self.error) = (self.y1, y, error);
        y
    }
}
