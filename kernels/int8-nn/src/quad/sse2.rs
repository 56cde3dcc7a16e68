//! Four words in an SSE2 register, which every x86-64 has. LLVM generates no PMADDWD from the loops of
//! `plain.rs`, which take four times as many instructions.
#![expect(unsafe_code, reason = "calls SSE2 intrinsics")]

use core::arch::x86_64::{
    __m128i, _mm_add_epi32, _mm_cvtsi128_si64, _mm_madd_epi16, _mm_set_epi32, _mm_slli_epi16,
    _mm_srai_epi16, _mm_unpackhi_epi64,
};

use crate::pair::Pair;

/// Four [`Pair`]s, or four `i32` sums.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quad(__m128i);

impl Quad {
    /// Packs four pairs.
    #[inline(always)]
    pub(crate) fn new(pairs: [Pair; 4]) -> Self {
        // SAFETY: `quad.rs` compiles this file only for targets with SSE2.
        Self(unsafe { new(pairs) })
    }

    /// Returns the low byte of each 16-bit number, sign-extended.
    #[inline(always)]
    pub(crate) fn low_bytes(self) -> Self {
        // SAFETY: `quad.rs` compiles this file only for targets with SSE2.
        Self(unsafe { low_bytes(self.0) })
    }

    /// Returns `sums` plus the dot product of each pair of `self` and `other`, wrapping.
    #[inline(always)]
    pub(crate) fn multiply_add(self, other: Self, sums: Self) -> Self {
        // SAFETY: `quad.rs` compiles this file only for targets with SSE2.
        Self(unsafe { multiply_add(self.0, other.0, sums.0) })
    }

    /// Returns the four sums.
    #[inline(always)]
    pub(crate) fn words(self) -> [i32; 4] {
        // SAFETY: `quad.rs` compiles this file only for targets with SSE2.
        unsafe { words(self.0) }
    }
}

#[inline]
#[target_feature(enable = "sse2")]
fn new(pairs: [Pair; 4]) -> __m128i {
    let [a, b, c, d] = pairs.map(|pair| pair.0.cast_signed());
    _mm_set_epi32(d, c, b, a)
}

#[inline]
#[target_feature(enable = "sse2")]
fn low_bytes(pairs: __m128i) -> __m128i {
    _mm_srai_epi16::<8>(_mm_slli_epi16::<8>(pairs))
}

#[inline]
#[target_feature(enable = "sse2")]
fn multiply_add(pairs: __m128i, others: __m128i, sums: __m128i) -> __m128i {
    _mm_add_epi32(_mm_madd_epi16(pairs, others), sums)
}

#[inline]
#[target_feature(enable = "sse2")]
#[expect(clippy::cast_possible_truncation, reason = "each cast keeps one half")]
fn words(sums: __m128i) -> [i32; 4] {
    let [low, high] = [sums, _mm_unpackhi_epi64(sums, sums)].map(|half| _mm_cvtsi128_si64(half));
    [
        low as i32,
        (low >> 32) as i32,
        high as i32,
        (high >> 32) as i32,
    ]
}
