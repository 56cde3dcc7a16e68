//! The 64-bit accumulator of a filter section. A Cortex-M adds a product to it with one instruction
//! (SMLAL).

/// 64-bit sum in Q32. After all products have been added, the high word is the section's output and
/// the low word its rounding error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Accumulator {
    /// Integer part of the sum, in the unit of the output.
    pub(crate) high: i32,
    /// Fraction of the sum, Q0.32 in the unit of the output, in [0, 1).
    pub(crate) low: u32,
}

impl Accumulator {
    /// Adds `fraction * x`, Q0.32 times an integer; wraps modulo 2^64.
    ///
    /// SMLAL is inline assembly, because the compiler would merge the constant integer and fraction
    /// of a coefficient into one 64-bit multiplication, which takes three times as many
    /// instructions.
    #[cfg(all(target_arch = "arm", target_has_atomic = "32"))]
    #[expect(unsafe_code, reason = "the instruction has no safe name in Rust")]
    #[inline(always)]
    pub(crate) fn multiply_add(self, fraction: i32, x: i32) -> Self {
        let Self { mut high, mut low } = self;
        // SAFETY: SMLAL (ARMv7-M ARM, A7.7.138) reads these four registers and writes `low` and
        // `high`. It accesses no memory and leaves the flags unchanged. The `cfg` above excludes
        // ARMv6-M, which has neither SMLAL nor the compare-and-swap that `target_has_atomic` tests.
        unsafe {
            core::arch::asm!(
                "smlal {low}, {high}, {fraction}, {x}",
                low = inout(reg) low,
                high = inout(reg) high,
                fraction = in(reg) fraction,
                x = in(reg) x,
                options(pure, nomem, nostack, preserves_flags),
            );
        }
        Self { high, low }
    }

    /// Adds `fraction * x` on machines without SMLAL, with the same bits as the assembly.
    ///
    /// `cargo xtask bench filters` compares both on an emulated Cortex-M4 and M7: with the model's
    /// coefficients, and with random coefficients and samples (contender `ours-any-sections`).
    #[cfg(not(all(target_arch = "arm", target_has_atomic = "32")))]
    #[inline(always)]
    pub(crate) fn multiply_add(self, fraction: i32, x: i32) -> Self {
        Self::from_q32(self.to_q32().wrapping_add(i64::from(fraction) * i64::from(x)))
    }

    #[cfg(any(test, not(all(target_arch = "arm", target_has_atomic = "32"))))]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the two halves of a 64-bit word"
    )]
    const fn from_q32(sum: i64) -> Self {
        Self { high: (sum >> 32) as i32, low: sum as u32 }
    }

    #[cfg(any(test, not(all(target_arch = "arm", target_has_atomic = "32"))))]
    const fn to_q32(self) -> i64 {
        ((self.high as i64) << 32) | self.low as i64
    }
}
