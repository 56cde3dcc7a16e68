//! Two 16-bit numbers in one word.

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Two `i16` in a 32-bit word, the first in its low half.
///
/// One SIMD instruction of a Cortex-M4 or M7 adds or multiplies both numbers. Planes and weights
/// are slices of pairs; each pair holds two channels or two inputs.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, Immutable, IntoBytes, KnownLayout,
)]
#[repr(transparent)]
pub struct Pair(pub u32);

impl Pair {
    /// The pair (0, 0).
    pub const ZERO: Self = Self(0);

    /// Packs two numbers into a word, the first into the low half.
    #[inline(always)]
    #[expect(clippy::cast_sign_loss, reason = "the bits are kept")]
    pub const fn new([first, second]: [i16; 2]) -> Self {
        Self(first as u16 as u32 | (second as u16 as u32) << 16)
    }

    /// Returns the two numbers, low half first.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "each cast keeps one half")]
    pub const fn get(self) -> [i16; 2] {
        [self.0 as i16, (self.0 >> 16) as i16]
    }

    /// Packs `numbers` into `pairs`, two into each. An odd last number is paired with 0; pairs
    /// beyond the numbers are unchanged.
    #[inline]
    pub fn fill(pairs: &mut [Self], mut numbers: impl Iterator<Item = i16>) {
        for pair in pairs {
            let Some(first) = numbers.next() else { return };
            *pair = Self::new([first, numbers.next().unwrap_or(0)]);
        }
    }

    /// Returns this pair with number `index` (0 or 1) replaced.
    #[must_use]
    #[inline]
    #[expect(clippy::cast_sign_loss, reason = "the bits are kept")]
    pub const fn with(self, index: usize, number: i16) -> Self {
        // Replaces the number by shifts. An array with an index known only at run time would be put
        // on the stack.
        let shift = if index == 0 { 0 } else { 16 };
        Self(self.0 & !(0xffff << shift) | (number as u16 as u32) << shift)
    }

    /// Returns a pair of the first number of `self` and the first number of `other` (PKHBT).
    #[inline(always)]
    pub(crate) const fn low_halves(self, other: Self) -> Self {
        Self(self.0 & 0xffff | other.0 << 16)
    }

    /// Returns both numbers times four, by one shift of the word; both must be in 0..2^13.
    #[inline(always)]
    pub(crate) fn quadrupled(self) -> Self {
        debug_assert!(
            self.get().iter().all(|lane| (0..1 << 13).contains(lane)),
            "the low lane would overflow into the high lane"
        );
        Self(self.0 << 2)
    }

    /// Returns `sum` plus the product of the first numbers and the product of the second numbers
    /// (SMLAD); wraps.
    #[inline(always)]
    pub fn multiply_add(self, other: Self, sum: i32) -> i32 {
        #[cfg(smlad)]
        {
            let result;
            // SAFETY: SMLAD (ARMv7-M ARM, A7.7, DSP extension) reads three registers, and writes
            // one register and the Q flag of the APSR, which no code here reads.
            #[expect(unsafe_code, reason = "the instruction has no safe name in Rust")]
            unsafe {
                core::arch::asm!(
                    "smlad {result}, {a}, {b}, {sum}",
                    result = lateout(reg) result,
                    a = in(reg) self.0,
                    b = in(reg) other.0,
                    sum = in(reg) sum,
                    options(pure, nomem, nostack),
                );
            }
            result
        }
        #[cfg(not(smlad))]
        {
            let ([a, b], [c, d]) = (self.get(), other.get());
            let product = |x: i16, y: i16| i32::from(x) * i32::from(y);
            sum.wrapping_add(product(a, c)).wrapping_add(product(b, d))
        }
    }

    /// Applies `operation` to both first numbers and to both second numbers.
    #[cfg(not(smlad))]
    #[inline(always)]
    fn map2(self, other: Self, operation: impl Fn(i16, i16) -> i16) -> Self {
        let ([a, b], [c, d]) = (self.get(), other.get());
        Self::new([operation(a, c), operation(b, d)])
    }
}

/// Executes the SIMD instruction `$name` on two pairs.
#[cfg(smlad)]
macro_rules! lane_wise {
    ($name:literal, $a:expr, $b:expr) => {{
        let result;
        // SAFETY: SADD16 and SSUB16 (ARMv7-M ARM, A7.7, DSP extension) read two registers, and
        // write one register and the GE flags of the APSR, which no other code here reads.
        #[expect(unsafe_code, reason = "the instruction has no safe name in Rust")]
        unsafe {
            core::arch::asm!(
                concat!($name, " {result}, {a}, {b}"),
                result = lateout(reg) result,
                a = in(reg) $a.0,
                b = in(reg) $b.0,
                options(pure, nomem, nostack),
            );
        }
        Pair(result)
    }};
}

impl core::ops::Add for Pair {
    type Output = Self;

    /// Adds the two first numbers and the two second numbers; both sums wrap.
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        #[cfg(smlad)]
        return lane_wise!("sadd16", self, other);
        #[cfg(not(smlad))]
        self.map2(other, i16::wrapping_add)
    }
}

impl core::ops::Sub for Pair {
    type Output = Self;

    /// Subtracts the two numbers of `other` from the two numbers of `self`; both differences wrap.
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        #[cfg(smlad)]
        return lane_wise!("ssub16", self, other);
        #[cfg(not(smlad))]
        self.map2(other, i16::wrapping_sub)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_do_not_carry_into_each_other() {
        let (a, b) = (Pair::new([-1, i16::MAX]), Pair::new([1, 1]));
        assert_eq!((a + b).get(), [0, i16::MIN]);
        assert_eq!((b - a).get(), [2, i16::MIN + 2]);
        assert_eq!(Pair::new([255, 3]).quadrupled().get(), [1020, 12]);
        assert_eq!(Pair::new([-3, 5]).multiply_add(Pair::new([7, -11]), 100), 24);
    }
}
