//! Loads between the products, for a Cortex-M7, which issues an LDR and an SMLAD in the same cycle.
#![expect(
    unsafe_code,
    reason = "LLVM does not generate SMLAD from Rust, and the loop needs every register"
)]
#![expect(clippy::too_many_lines, reason = "one loop, one instruction per line")]

use core::arch::naked_asm;

use super::Arguments;
use crate::dot::{ROUND, weights_len};

/// Defines a kernel for a number of segments, a width and a stride; `$shared` says whether all
/// blocks use the same weights. One iteration computes `$blocks` blocks, and updates the pointers
/// on the stack once.
///
/// r0-r5: sums; r6-r9: weights of a round (two words of the first output, two of the second);
/// r10-r11: inputs of a position; r12: next position of a segment; lr: weights of this round. The
/// other arguments stay on the stack. Within a segment, each register is reloaded right after its
/// last use, and at least two other products precede its next use.
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
                // Load the weights of the first round; those of each later round are loaded one
                // round ahead.
                ".if {shared} || (block == 0)",
                "ldm lr, {{r6-r9}}",
                ".endif",
                ".set segment, 0",
                ".rept {segments}",
                "ldr r12, [sp, #(4 * segment)]",
                ".set at, 3 * {position} * block",
                "ldr r10, [r12, #at]",
                "ldr r11, [r12, #(at + 4)]",
                ".set round, 0",
                ".rept {rounds}",
                ".set last_of_segment, round == {rounds} - 1",
                ".set last_of_block, last_of_segment && (segment == {segments} - 1)",
                ".set more, !(last_of_block && ({shared} || (block == {blocks} - 1)))",
                ".if segment + round == 0",
                "smuad r0, r10, r6",
                "smuad r1, r10, r8",
                ".else",
                "smlad r0, r10, r6, r0",
                "smlad r1, r10, r8, r1",
                ".endif",
                "ldr r10, [r12, #(at + {position})]",
                "smlad r0, r11, r7, r0",
                "smlad r1, r11, r9, r1",
                "ldr r11, [r12, #(at + {position} + 4)]",
                ".if segment + round == 0",
                "smuad r2, r10, r6",
                "smuad r3, r10, r8",
                ".else",
                "smlad r2, r10, r6, r2",
                "smlad r3, r10, r8, r3",
                ".endif",
                "ldr r10, [r12, #(at + 2 * {position})]",
                "smlad r2, r11, r7, r2",
                "smlad r3, r11, r9, r3",
                "ldr r11, [r12, #(at + 2 * {position} + 4)]",
                ".if segment + round == 0",
                "smuad r4, r10, r6",
                ".else",
                "smlad r4, r10, r6, r4",
                ".endif",
                ".if more",
                "ldr r6, [lr, #16]!",
                ".endif",
                ".if segment + round == 0",
                "smuad r5, r10, r8",
                ".else",
                "smlad r5, r10, r8, r5",
                ".endif",
                ".set at, at + 8",
                ".if !last_of_segment",
                "ldr r10, [r12, #at]",
                ".endif",
                "smlad r4, r11, r7, r4",
                ".if more",
                "ldr r8, [lr, #8]",
                ".endif",
                "smlad r5, r11, r9, r5",
                ".if more",
                "ldr r7, [lr, #4]",
                "ldr r9, [lr, #12]",
                ".endif",
                ".if !last_of_segment",
                "ldr r11, [r12, #(at + 4)]",
                ".endif",
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
                // Move lr from the weights of the last round to those of the next block's first
                // round.
                ".if {shared}",
                "sub lr, #({weights_of_block} - 16)",
                ".elseif block == {blocks} - 1",
                "add lr, #16",
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
