//! The 64-bit sum of a section: one multiply-accumulate instruction on a Cortex-M.

/// A sum in Q32: the high word is the result, the low word the part below one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Accumulator {
    /// Output steps.
    pub(crate) high: i32,
    /// Parts of an output step, Q0.32, in [0, 1).
    pub(crate) low: u32,
}

impl Accumulator {
    /// Adds `remainder * x`, Q0.32 times an integer; wraps modulo 2^64.
    ///
    /// Written out as SMLAL: left to itself, the compiler merges the constant integer and remainder
    /// of a coefficient back into one 64-bit multiplication, three times as many instructions.
    #[cfg(all(target_arch = "arm", target_has_atomic = "32"))]
    #[expect(unsafe_code, reason = "the instruction has no safe name in Rust")]
    #[inline(always)]
    pub(crate) fn multiply_add(self, remainder: i32, x: i32) -> Self {
        let Self { mut high, mut low } = self;
        // SAFETY: SMLAL (ARMv7-M ARM, A7.7.138) reads and writes these four registers and nothing
        // else, not even the flags. ARMv6-M lacks it; it has no compare-and-swap either, which is
        // what `target_has_atomic` asks for.
        unsafe {
            core::arch::asm!(
                "smlal {low}, {high}, {remainder}, {x}",
                low = inout(reg) low,
                high = inout(reg) high,
                remainder = in(reg) remainder,
                x = in(reg) x,
                options(pure, nomem, nostack, preserves_flags),
            );
        }
        Self { high, low }
    }

    /// The same on every other machine. `cargo xtask bench filters` holds the two equal on an emulated
    /// Cortex-M4 and M7: with the model's coefficients, and with any coefficients and samples
    /// (contender `ours-any-sections`).
    #[cfg(not(all(target_arch = "arm", target_has_atomic = "32")))]
    #[inline(always)]
    pub(crate) fn multiply_add(self, remainder: i32, x: i32) -> Self {
        Self::from_q32(
            self.to_q32()
                .wrapping_add(i64::from(remainder) * i64::from(x)),
        )
    }

    #[cfg(any(test, not(all(target_arch = "arm", target_has_atomic = "32"))))]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the two halves of a 64-bit word"
    )]
    const fn from_q32(sum: i64) -> Self {
        Self {
            high: (sum >> 32) as i32,
            low: sum as u32,
        }
    }

    #[cfg(any(test, not(all(target_arch = "arm", target_has_atomic = "32"))))]
    const fn to_q32(self) -> i64 {
        ((self.high as i64) << 32) | self.low as i64
    }
}
