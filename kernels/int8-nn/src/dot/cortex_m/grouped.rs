//! Loads in groups, for a Cortex-M4: one LDM and three LDRD for every twelve SMLAD.
#![expect(
    unsafe_code,
    reason = "LLVM does not generate SMLAD from Rust, and the loop needs every register"
)]

use core::arch::naked_asm;

use super::Arguments;
use crate::dot::{ROUND, weights_len};

/// Defines a kernel for a number of segments, a width and a stride; `$shared` says whether all
/// blocks use the same weights. One iteration computes `$blocks` blocks, and updates the pointers
/// on the stack once.
///
/// r0-r5: sums; r6-r9: weights of a round (two words of the first output, two of the second);
/// r10-r11: inputs of a position; r12: next position of a segment; lr: weights. The other arguments
/// stay on the stack.
macro_rules! kernel {
    ($name:ident, $segments:literal, $width:literal, $stride:literal, $blocks:literal, $shared:literal) => {
        #[unsafe(naked)]
        pub(super) unsafe extern "C" fn $name(arguments: *const ()) {
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
                ".set block, 0",
                ".rept {blocks}",
                ".set segment, 0",
                ".rept {segments}",
                "ldr r12, [sp, #(4 * segment)]",
                ".set round, 0",
                ".rept {rounds}",
                "ldm lr!, {{r6-r9}}",
                "ldrd r10, r11, [r12, #(3 * {position} * block + 8 * round)]",
                ".if segment + round == 0",
                "smuad r0, r10, r6",
                "smuad r1, r10, r8",
                ".else",
                "smlad r0, r10, r6, r0",
                "smlad r1, r10, r8, r1",
                ".endif",
                "smlad r0, r11, r7, r0",
                "smlad r1, r11, r9, r1",
                "ldrd r10, r11, [r12, #((3 * block + 1) * {position} + 8 * round)]",
                ".if segment + round == 0",
                "smuad r2, r10, r6",
                "smuad r3, r10, r8",
                ".else",
                "smlad r2, r10, r6, r2",
                "smlad r3, r10, r8, r3",
                ".endif",
                "smlad r2, r11, r7, r2",
                "smlad r3, r11, r9, r3",
                "ldrd r10, r11, [r12, #((3 * block + 2) * {position} + 8 * round)]",
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
                ".if block == {blocks} - 1",
                "add r12, #(3 * {position} * {blocks})",
                "str r12, [sp, #(4 * segment)]",
                ".endif",
                ".set segment, segment + 1",
                ".endr",
                "ldr r12, [sp, #{sums}]",
                "stm r12!, {{r0-r5}}",
                "str r12, [sp, #{sums}]",
                ".if {shared}",
                "sub lr, #{weights_of_block}",
                ".endif",
                ".set block, block + 1",
                ".endr",
                "ldr r11, [sp, #{end}]",
                "cmp r12, r11",
                "bne.w 2b",
                "add sp, #{frame}",
                "pop {{r4-r11, pc}}",
                segments = const $segments,
                blocks = const $blocks,
                rounds = const $width / ROUND,
                position = const 4 * $stride,
                frame = const size_of::<Arguments<$segments>>(),
                weights = const core::mem::offset_of!(Arguments<$segments>, weights),
                sums = const core::mem::offset_of!(Arguments<$segments>, sums),
                shared = const $shared as usize,
                weights_of_block = const 4 * weights_len($segments * $width),
                end = const core::mem::offset_of!(Arguments<$segments>, end),
            );
        }
    };
}

kernel!(dots_1x14, 1, 14, 14, 4, true);
kernel!(dots_3x8, 3, 8, 8, 8, false);
kernel!(dots_9x24, 9, 24, 8, 1, true);
