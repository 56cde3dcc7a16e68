//! Loads in groups: an LDM and three LDRD for twelve SMLAD.
#![expect(
    unsafe_code,
    reason = "LLVM makes no SMLAD of Rust, and the loop needs every register there is"
)]

use core::arch::naked_asm;

use super::Work;
use crate::dot::{ROUND, weights_len};

/// The loop for a number of segments, a width and a stride, with weights shared by all steps or not,
/// over so many steps at a time: the pointers on the stack are moved once for all of them.
///
/// r0-r5 sums, r6-r9 weights of a round (the first output's two words, then the second's), r10-r11
/// inputs of a position, r12 a segment's next position, lr the weights. The rest of the work stays
/// on the stack. A round is one LDM and three LDRD for twelve SMLAD.
macro_rules! kernel {
    ($name:ident, $segments:literal, $width:literal, $stride:literal, $steps:literal, $shared:literal) => {
        #[unsafe(naked)]
        pub(super) unsafe extern "C" fn $name(work: *const ()) {
            naked_asm!(
                "push {{r4-r11, lr}}",
                "sub sp, #{frame}",
                ".set at, 0",
                ".rept {frame} / 4",
                "ldr r1, [r0, #at]",
                "str r1, [sp, #at]",
                ".set at, at + 4",
                ".endr",
                "ldr lr, [sp, #{weights}]",
                "2:",
                ".set step, 0",
                ".rept {steps}",
                ".set segment, 0",
                ".rept {segments}",
                "ldr r12, [sp, #(4 * segment)]",
                ".set round, 0",
                ".rept {rounds}",
                "ldm lr!, {{r6-r9}}",
                "ldrd r10, r11, [r12, #(3 * {position} * step + 8 * round)]",
                ".if segment + round == 0",
                "smuad r0, r10, r6",
                "smuad r1, r10, r8",
                ".else",
                "smlad r0, r10, r6, r0",
                "smlad r1, r10, r8, r1",
                ".endif",
                "smlad r0, r11, r7, r0",
                "smlad r1, r11, r9, r1",
                "ldrd r10, r11, [r12, #((3 * step + 1) * {position} + 8 * round)]",
                ".if segment + round == 0",
                "smuad r2, r10, r6",
                "smuad r3, r10, r8",
                ".else",
                "smlad r2, r10, r6, r2",
                "smlad r3, r10, r8, r3",
                ".endif",
                "smlad r2, r11, r7, r2",
                "smlad r3, r11, r9, r3",
                "ldrd r10, r11, [r12, #((3 * step + 2) * {position} + 8 * round)]",
                ".if segment + round == 0",
                "smuad r4, r10, r6",
                "smuad r5, r10, r8",
                ".else",
                "smlad r4, r10, r6, r4",
                "smlad r5, r10, r8, r5",
                ".endif",
                "smlad r4, r11, r7, r4",
                "smlad r5, r11, r9, r5",
                ".set round, round + 1",
                ".endr",
                ".if step == {steps} - 1",
                "add r12, #(3 * {position} * {steps})",
                "str r12, [sp, #(4 * segment)]",
                ".endif",
                ".set segment, segment + 1",
                ".endr",
                "ldr r12, [sp, #{sums}]",
                "stm r12!, {{r0-r5}}",
                "str r12, [sp, #{sums}]",
                ".if {shared}",
                "sub lr, #{weights_of_step}",
                ".endif",
                ".set step, step + 1",
                ".endr",
                "ldr r11, [sp, #{end}]",
                "cmp r12, r11",
                "bne.w 2b",
                "add sp, #{frame}",
                "pop {{r4-r11, pc}}",
                segments = const $segments,
                steps = const $steps,
                rounds = const $width / ROUND,
                position = const 4 * $stride,
                frame = const size_of::<Work<$segments>>(),
                weights = const core::mem::offset_of!(Work<$segments>, weights),
                sums = const core::mem::offset_of!(Work<$segments>, sums),
                shared = const $shared as usize,
                weights_of_step = const 4 * weights_len($segments * $width),
                end = const core::mem::offset_of!(Work<$segments>, end),
            );
        }
    };
}

kernel!(dots_1x14, 1, 14, 14, 4, true);
kernel!(dots_3x8, 3, 8, 8, 8, false);
kernel!(dots_9x24, 9, 24, 8, 1, true);
