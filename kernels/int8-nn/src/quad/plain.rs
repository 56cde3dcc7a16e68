//! Four words in plain Rust, for processors without SSE2, and as the reference for `sse2`.

use crate::pair::Pair;

/// Four [`Pair`]s, or four `i32` sums.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quad([u32; 4]);

impl Quad {
    /// Packs four pairs.
    #[inline(always)]
    pub(crate) fn new(pairs: [Pair; 4]) -> Self {
        Self(pairs.map(|pair| pair.0))
    }

    /// Returns the low byte of each 16-bit number, sign-extended.
    #[cfg(not(smlad))]
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the low byte")]
    pub(crate) fn low_bytes(self) -> Self {
        let low_byte = |number: i16| i16::from(number as i8);
        Self::new(self.0.map(|word| Pair::new(Pair(word).get().map(low_byte))))
    }

    /// Returns `sums` plus the dot product of each pair of `self` and `other`, wrapping.
    #[inline(always)]
    pub(crate) fn multiply_add(self, other: Self, sums: Self) -> Self {
        Self(core::array::from_fn(|at| {
            let [a, b] = Pair(self.0[at]).get().map(i32::from);
            let [c, d] = Pair(other.0[at]).get().map(i32::from);
            let sum = sums.0[at].cast_signed();
            sum.wrapping_add(a * c).wrapping_add(b * d).cast_unsigned()
        }))
    }

    /// Returns the four sums.
    #[inline(always)]
    pub(crate) fn words(self) -> [i32; 4] {
        self.0.map(u32::cast_signed)
    }
}
