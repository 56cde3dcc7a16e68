//! Winograd's inverse transform, from sums of products to pooled outputs, on a Cortex-M4 or M7.
#![expect(unsafe_code, reason = "LLVM spills registers to the stack: 50 % more instructions")]

use core::arch::naked_asm;

use super::tile::{PRODUCTS, Sums, TRANSFORMED_TILE, WINDOWS};
use crate::dot::OUTPUTS;

/// Computes the outputs of `tiles` tiles for a pair of output channels from `sums`, and keeps the
/// maximum of each pool window in `windows[(tile * WINDOWS + window) * outputs + output]`.
/// `windows` must end with the last number that this formula selects.
#[inline(always)]
pub(super) fn keep_largest(
    sums: &[Sums; PRODUCTS],
    tiles: usize,
    outputs: usize,
    windows: &mut [i32],
) {
    // SAFETY: both pointers come from slices that are borrowed until `tiles_of_pair` returns, and
    // only that function uses them. There are 1 to POSITIONS tiles, so their sums are in the first
    // OUTPUTS * tiles words of each product. The last address used in `windows` is the address of
    // the last tile's second window and second output, which is the last number of the slice.
    // `Winograd::is_consistent`, which `convolve_max_pool` asserts, makes all byte offsets fit 32
    // bits.
    unsafe {
        tiles_of_pair(
            sums.as_ptr().cast(),
            windows.as_mut_ptr(),
            size_of::<i32>() * outputs,
            OUTPUTS * tiles,
        );
    }
}

/// Inverse-transforms and pools two rows of outputs for each of `count` combinations of tile and
/// output channel.
///
/// r0: sums; r1: windows; r2: bytes from one window to the next; r3: combinations left; r4-r9: six
/// sums of a row; r10, r11: maxima of both windows; r12, lr: scratch.
#[unsafe(naked)]
unsafe extern "C" fn tiles_of_pair(
    sums: *const i32,
    windows: *mut i32,
    outputs: usize,
    count: usize,
) {
    naked_asm!(
        ".macro sum_rows to, x, first, subtract",
        "ldr \\to, [r0, #(\\x * {sums} + \\first * {row})]",
        "ldr r12, [r0, #(\\x * {sums} + (\\first + 1) * {row})]",
        "ldr lr, [r0, #(\\x * {sums} + (\\first + 2) * {row})]",
        ".if \\subtract",
        "subs \\to, \\to, r12",
        "subs \\to, \\to, lr",
        ".else",
        "adds \\to, \\to, r12",
        "adds \\to, \\to, lr",
        ".endif",
        ".endm",
        ".macro maximum to, other",
        "cmp \\to, \\other",
        "it lt",
        "movlt \\to, \\other",
        ".endm",
        // Turns the six sums of a row, r4-r9, into the maxima of two pool windows, r4 and r6.
        ".macro row_outputs",
        "add r12, r5, r6",
        "sub r5, r5, r6",
        "add lr, r7, r8",
        "sub r7, r7, r8",
        "add r4, r4, r12",
        "add r4, r4, lr",
        "add r6, r12, lr, lsl #2",
        "add r8, r5, r7, lsl #1",
        "add r5, r5, r7, lsl #3",
        "add r5, r5, r9",
        "maximum r4, r8",
        "maximum r6, r5",
        ".endm",
        "push {{r4-r11, lr}}",
        "2:",
        "sum_rows r4, 0, 0, 0",
        "sum_rows r5, 1, 0, 0",
        "sum_rows r6, 2, 0, 0",
        "sum_rows r7, 3, 0, 0",
        "sum_rows r8, 4, 0, 0",
        "sum_rows r9, 5, 0, 0",
        "row_outputs",
        "mov r10, r4",
        "mov r11, r6",
        "sum_rows r4, 0, 1, 1",
        "sum_rows r5, 1, 1, 1",
        "sum_rows r6, 2, 1, 1",
        "sum_rows r7, 3, 1, 1",
        "sum_rows r8, 4, 1, 1",
        "sum_rows r9, 5, 1, 1",
        "row_outputs",
        "maximum r4, r10",
        "maximum r6, r11",
        "ldr r10, [r1]",
        "ldr r11, [r1, r2]",
        "maximum r4, r10",
        "maximum r6, r11",
        "str r6, [r1, r2]",
        "str r4, [r1], #4",
        "add r0, #4",
        // After the second output channel of a tile, r1 moves to the first window of the next tile.
        "subs r3, #1",
        "tst r3, #1",
        "ittt eq",
        "addeq r1, r1, r2, lsl #1",
        "subeq r1, #{pair}",
        "cmpeq r3, #0",
        "bne.w 2b",
        "pop {{r4-r11, pc}}",
        ".purgem sum_rows",
        ".purgem maximum",
        ".purgem row_outputs",
        sums = const size_of::<Sums>(),
        row = const TRANSFORMED_TILE[1] * size_of::<Sums>(),
        pair = const OUTPUTS * size_of::<i32>(),
    );
}

const _: () = assert!(
    WINDOWS == 2 && OUTPUTS == 2,
    "the assembler is written for two windows and two outputs"
);
