//! Rice codes whose length is bounded.
//!
//! A difference is folded to a natural number. The bits above its lowest k bits are written in
//! unary: as many zeros as their value, then a one. The lowest k bits follow. If the number of
//! zeros would be [`ESCAPE`] or more, `ESCAPE` zeros and the count itself are written instead, so
//! that no code is longer than 32 bits.

/// Number of leading zeros that announce an unpredicted count instead of a difference.
pub(crate) const ESCAPE: u32 = 8;

/// Largest k; a code then takes at most `ESCAPE + 24` = 32 bits.
pub(crate) const MAX_K: u32 = 24;

/// Number of bits of a count, which is written if the code of its difference would be too long.
pub(crate) const COUNT_BITS: u32 = 24;

/// Folds a difference to a natural number: 0, -1, 1, -2, .. become 0, 1, 2, 3, ..
#[inline]
pub(crate) const fn fold(difference: i32) -> u32 {
    ((difference << 1) ^ (difference >> 31)).cast_unsigned()
}

/// Inverts [`fold`].
pub(crate) const fn unfold(folded: u32) -> i32 {
    (folded >> 1).cast_signed() ^ -(folded & 1).cast_signed()
}

/// Returns the code of a folded difference: its bits and their number, 1 to 32. If this code would
/// start with [`ESCAPE`] zeros or more, returns the code that holds `count` instead.
#[inline]
pub(crate) const fn code(folded: u32, k: u32, count: i32) -> (u32, u32) {
    let zeros = folded >> k;
    if zeros < ESCAPE {
        // The 1 bit that ends the zeros, then the lowest k bits: 2^k + (folded - zeros * 2^k).
        let bits = folded.wrapping_sub(zeros.wrapping_sub(1) << k);
        (bits, zeros + 1 + k)
    } else {
        (count.cast_unsigned() & 0x00ff_ffff, ESCAPE + COUNT_BITS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folding_numbers_the_differences_by_their_size() {
        assert_eq!([0, -1, 1, -2, 2].map(fold), [0, 1, 2, 3, 4]);
        for difference in [0, 1, -1, 12_345, -67_890, (1 << 26) - 1, -(1 << 26)] {
            assert_eq!(unfold(fold(difference)), difference);
        }
    }

    #[test]
    fn no_code_is_longer_than_32_bits() {
        for k in 0..=MAX_K {
            for folded in [0, 1, (7 << k) | ((1 << k) - 1), (8 << k) - 1, 8 << k] {
                let (bits, width) = code(folded, k, -1);
                assert!((1..=32).contains(&width), "{folded} with k {k}");
                assert!(u64::from(bits) < 1 << width, "{folded} with k {k}");
            }
        }
    }
}
