//! Octets in an AVX2 register.
#![expect(unsafe_code, reason = "calls AVX2 intrinsics, after a test that the processor has them")]

use core::arch::x86_64::{
    __m256i, _mm_cvtsi128_si64, _mm_hadd_epi32, _mm_loadu_si128, _mm256_add_epi32,
    _mm256_broadcastsi128_si256, _mm256_castsi256_si128, _mm256_extract_epi64,
    _mm256_extracti128_si256, _mm256_hadd_epi32, _mm256_loadu_si256, _mm256_madd_epi16,
    _mm256_permute4x64_epi64, _mm256_permutevar8x32_epi32, _mm256_setr_epi32, _mm256_setzero_si256,
    _mm256_slli_epi16, _mm256_srai_epi16,
};

use crate::{
    dot::{OUTPUTS, POSITIONS},
    octet::{INPUTS, Kernel, Octet, WEIGHTS},
    pair::Pair,
};

cpufeatures::new!(detected, "avx2");

/// If the processor has AVX2, runs the kernel and returns `None`; otherwise returns the kernel.
#[inline(always)]
pub(super) fn run_if_available<K: Kernel>(kernel: K) -> Option<K> {
    if detected::get() {
        // SAFETY: `detected` has found that the processor has AVX2.
        unsafe { run(kernel) };
        None
    } else {
        Some(kernel)
    }
}

#[target_feature(enable = "avx2")]
fn run(kernel: impl Kernel) {
    kernel.run::<Avx2>();
}

/// An octet with the words in the order `[output][round][pair]`: the first output in the low half.
/// Only [`run`] uses this type, so that all its functions run on a processor with AVX2.
#[derive(Clone, Copy, Debug)]
struct Avx2(__m256i);

impl Octet for Avx2 {
    #[inline(always)]
    fn zeros() -> Self {
        // SAFETY: this runs only on a processor with AVX2; see `Avx2`.
        Self(unsafe { _mm256_setzero_si256() })
    }

    #[inline(always)]
    fn inputs(pairs: &[Pair; INPUTS]) -> Self {
        // SAFETY: this runs only on a processor with AVX2; see `Avx2`.
        Self(unsafe { inputs(pairs) })
    }

    #[inline(always)]
    fn weights(pairs: &[Pair; WEIGHTS]) -> Self {
        // SAFETY: this runs only on a processor with AVX2; see `Avx2`.
        Self(unsafe { weights(pairs) })
    }

    #[inline(always)]
    fn low_bytes(self) -> Self {
        // SAFETY: this runs only on a processor with AVX2; see `Avx2`.
        Self(unsafe { low_bytes(self.0) })
    }

    #[inline(always)]
    fn multiply_add(self, other: Self, sums: Self) -> Self {
        // SAFETY: this runs only on a processor with AVX2; see `Avx2`.
        Self(unsafe { multiply_add(self.0, other.0, sums.0) })
    }

    #[inline(always)]
    fn output_sums(self) -> [i32; OUTPUTS] {
        // SAFETY: this runs only on a processor with AVX2; see `Avx2`.
        unsafe { output_sums(self.0) }
    }

    #[inline(always)]
    fn position_sums([a, b, c]: [Self; POSITIONS]) -> [i32; POSITIONS * OUTPUTS] {
        // SAFETY: this runs only on a processor with AVX2; see `Avx2`.
        unsafe { position_sums([a.0, b.0, c.0]) }
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn inputs(pairs: &[Pair; INPUTS]) -> __m256i {
    const { assert!(size_of::<[Pair; INPUTS]>() == 16) };
    // SAFETY: the load reads the 16 bytes of the array, at any alignment.
    _mm256_broadcastsi128_si256(unsafe { _mm_loadu_si128(pairs.as_ptr().cast()) })
}

#[inline]
#[target_feature(enable = "avx2")]
fn weights(pairs: &[Pair; WEIGHTS]) -> __m256i {
    const { assert!(size_of::<[Pair; WEIGHTS]>() == 32) };
    // SAFETY: the load reads the 32 bytes of the array, at any alignment.
    let rounds = unsafe { _mm256_loadu_si256(pairs.as_ptr().cast()) };
    // Changes the order of the words from [round][output] to [output][round].
    _mm256_permute4x64_epi64::<0b11_01_10_00>(rounds)
}

#[inline]
#[target_feature(enable = "avx2")]
fn low_bytes(pairs: __m256i) -> __m256i {
    _mm256_srai_epi16::<8>(_mm256_slli_epi16::<8>(pairs))
}

#[inline]
#[target_feature(enable = "avx2")]
fn multiply_add(pairs: __m256i, others: __m256i, sums: __m256i) -> __m256i {
    _mm256_add_epi32(_mm256_madd_epi16(pairs, others), sums)
}

#[inline]
#[target_feature(enable = "avx2")]
fn output_sums(words: __m256i) -> [i32; OUTPUTS] {
    let first = _mm256_castsi256_si128(words);
    let second = _mm256_extracti128_si256::<1>(words);
    let halves = _mm_hadd_epi32(first, second);
    let both = _mm_cvtsi128_si64(_mm_hadd_epi32(halves, halves));
    halves_of(both)
}

#[inline]
#[target_feature(enable = "avx2")]
fn position_sums([a, b, c]: [__m256i; POSITIONS]) -> [i32; POSITIONS * OUTPUTS] {
    // Each half of `sums` holds the sums of one output: at positions 0, 1, 2 and again 2.
    let sums = _mm256_hadd_epi32(_mm256_hadd_epi32(a, b), _mm256_hadd_epi32(c, c));
    let by_position = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
    let sums = _mm256_permutevar8x32_epi32(sums, by_position);
    let [a, b] = halves_of(_mm256_extract_epi64::<0>(sums));
    let [c, d] = halves_of(_mm256_extract_epi64::<1>(sums));
    let [e, f] = halves_of(_mm256_extract_epi64::<2>(sums));
    [a, b, c, d, e, f]
}

/// Returns the low and the high half of a 64-bit word.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "each cast keeps one half")]
fn halves_of(words: i64) -> [i32; 2] {
    [words as i32, (words >> 32) as i32]
}
