//! The matrix product with SMLAD, which computes two products per instruction.
#![expect(
    unsafe_code,
    reason = "LLVM does not generate SMLAD from Rust, and the loop needs every register"
)]

use core::arch::naked_asm;

use super::{INPUTS, ROUND};
use crate::pair::Pair;

/// Adds `weights * inputs` to the accumulators. [`super::Linear::accumulate`] has checked the
/// lengths of the slices.
#[inline(always)]
pub(super) fn accumulate(inputs: &[Pair], weights: &[Pair], accumulators: &mut [i32]) {
    let (inputs, accumulators) = (inputs.as_ptr_range(), accumulators.as_mut_ptr_range());
    // SAFETY: the pointers come from the three slices, which are borrowed until `quads` returns,
    // and only `quads` uses them. The caller has asserted `Linear::is_consistent`: a multiple of 8
    // pairs of inputs and a multiple of 4 outputs, neither of them 0, and half of their product in
    // pairs of weights. It has cut inputs and accumulators to these lengths. The loops read and
    // write exactly that many elements.
    unsafe {
        quads(weights.as_ptr(), inputs.start, inputs.end, accumulators.start, accumulators.end);
    }
}

/// Accumulates four outputs at a time over all inputs. Apart from loads, four products take three
/// instructions.
///
/// r0: sum of products with the packed weights of the first pair of outputs; r1: sum of products
/// with the low bytes of these weights, which belong to the even output; r2, r3: as r0, r1, for the
/// second pair; r4-r7: packed weights; r8-r9: inputs; r10: low bytes of the weights; r11: next
/// input; r12: next weights; lr: end of the inputs.
#[unsafe(naked)]
unsafe extern "C" fn quads(
    weights: *const Pair,
    inputs: *const Pair,
    inputs_end: *const Pair,
    accumulators: *mut i32,
    accumulators_end: *mut i32,
) {
    naked_asm!(
        "push {{r1, r3, r4-r11, lr}}",
        "mov r12, r0",
        "mov lr, r2",
        "2:",
        "ldr r11, [sp]",
        "movs r0, #0",
        "movs r1, #0",
        "movs r2, #0",
        "movs r3, #0",
        "3:",
        ".rept {rounds}",
        "ldm r12!, {{r4-r7}}",
        "ldrd r8, r9, [r11], #8",
        "smlad r0, r8, r4, r0",
        "sxtb16 r10, r4",
        "smlad r1, r8, r10, r1",
        "smlad r0, r9, r5, r0",
        "sxtb16 r10, r5",
        "smlad r1, r9, r10, r1",
        "smlad r2, r8, r6, r2",
        "sxtb16 r10, r6",
        "smlad r3, r8, r10, r3",
        "smlad r2, r9, r7, r2",
        "sxtb16 r10, r7",
        "smlad r3, r9, r10, r3",
        ".endr",
        "cmp r11, lr",
        "bne.w 3b",
        "subs r0, r0, r1",
        "subs r2, r2, r3",
        "ldr r10, [sp, #4]",
        "ldm r10, {{r4-r7}}",
        "adds r4, r4, r1",
        "add r5, r5, r0, asr #8",
        "adds r6, r6, r3",
        "add r7, r7, r2, asr #8",
        "stm r10!, {{r4-r7}}",
        "str r10, [sp, #4]",
        // The fifth argument is on the stack, above the eleven registers saved there.
        "ldr r11, [sp, #44]",
        "cmp r10, r11",
        "bne.w 2b",
        "pop {{r1, r3, r4-r11, pc}}",
        rounds = const INPUTS / ROUND,
    );
}
