//! The two quantisers and the four states that choose between them.

use crate::rate::Rate;

/// State of the quantiser before a coefficient, 0..4; 0 before the first coefficient of a block.
///
/// There are two quantisers: points of quantiser 0 are even multiples of the step, points of
/// quantiser 1 are odd multiples and 0. States 0 and 1 use quantiser 0, states 2 and 3 quantiser 1,
/// and the parity of a magnitude chooses the next state. Together the points are one step apart,
/// but a coefficient costs only the bits of points two steps apart ("dependent quantisation" of
/// H.266, 7.4.11.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct State(u8);

impl State {
    /// The state before the first coefficient of a block.
    pub(crate) const START: Self = Self(0);

    /// Returns the quantiser that this state uses, 0 or 1.
    #[inline(always)]
    pub(crate) fn quantiser(self) -> usize {
        usize::from(self.0 >> 1)
    }

    /// Returns the state after a coefficient with this magnitude.
    #[inline(always)]
    pub(crate) fn after(self, magnitude: u16) -> Self {
        const NEXT: [[u8; 2]; 4] = [[0, 2], [2, 0], [1, 3], [3, 1]];
        Self(NEXT[usize::from(self.0) % 4][usize::from(magnitude % 2)])
    }
}

/// A quantised coefficient: sign and magnitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Magnitude {
    /// Index of the quantiser's point; 0 for zero, at most 2^16 - 1.
    pub value: u16,
    /// True if the coefficient is negative; not coded if `value` is 0.
    pub is_negative: bool,
}

impl Magnitude {
    /// A quantised coefficient of 0.
    pub const ZERO: Self = Self { value: 0, is_negative: false };
}

/// Adds a block's dequantised coefficients to their prediction, saturating. `state` holds the
/// prediction before the call, and afterwards the new state of encoder and decoder. If the slices
/// differ in length, the rest of the longer slice is ignored.
pub fn update_state(magnitudes: &[Magnitude], rate: Rate, state: &mut [i16]) {
    let mut quantiser = State::START;
    for (magnitude, state) in magnitudes.iter().zip(state) {
        let point = point(magnitude.value, quantiser.quantiser()) * rate.step();
        let value = if magnitude.is_negative { -point } else { point };
        #[expect(clippy::cast_possible_truncation, reason = "clamped to 16 bits")]
        let saturated = (i32::from(*state) + value).clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        *state = saturated;
        quantiser = quantiser.after(magnitude.value);
    }
}

/// Returns the value that a magnitude stands for, in steps: `2 * magnitude - quantiser`, or 0 for
/// the magnitude 0.
#[inline(always)]
pub(crate) fn point(magnitude: u16, quantiser: usize) -> i32 {
    let odd = i32::from(quantiser == 1 && magnitude > 0);
    2 * i32::from(magnitude) - odd
}
