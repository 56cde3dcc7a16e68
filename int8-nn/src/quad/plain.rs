//! Four words in plain Rust: the twin of [`super::sse2`], and what other processors run.

use crate::Pair;

/// Four pairs, or four sums.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quad([u32; 4]);

impl Quad {
    /// These pairs.
    #[inline(always)]
    pub(crate) fn new(pairs: [Pair; 4]) -> Self {
        Self(pairs.map(|pair| pair.0))
    }

    /// Of each number the low byte, as a number.
    #[cfg(not(smlad))]
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the low byte")]
    pub(crate) fn low_bytes(self) -> Self {
        let low_byte = |number: i16| i16::from(number as i8);
        Self::new(self.0.map(|word| Pair::new(Pair(word).get().map(low_byte))))
    }

    /// `self . other` of each pair on top of a sum, wrapping.
    #[inline(always)]
    pub(crate) fn multiply_add(self, other: Self, sums: Self) -> Self {
        Self(core::array::from_fn(|at| {
            let [a, b] = Pair(self.0[at]).get().map(i32::from);
            let [c, d] = Pair(other.0[at]).get().map(i32::from);
            let sum = sums.0[at].cast_signed();
            sum.wrapping_add(a * c).wrapping_add(b * d).cast_unsigned()
        }))
    }

    /// The four sums.
    #[inline(always)]
    pub(crate) fn words(self) -> [i32; 4] {
        self.0.map(u32::cast_signed)
    }
}
