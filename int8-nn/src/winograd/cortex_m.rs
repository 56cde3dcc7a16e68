//! The way back from products to pooled outputs on a Cortex-M4 or M7.
#![expect(
    unsafe_code,
    reason = "LLVM keeps what does not fit the registers on the stack: half as many instructions again"
)]

use core::arch::naked_asm;

use super::{FREQUENCIES, OUTPUTS, PRODUCTS, Sums, WINDOWS};

/// Keeps the largest; `windows` as long as [`super::keep_largest`] cuts it.
#[inline(always)]
pub(super) fn keep_largest(
    sums: &[Sums; PRODUCTS],
    tiles: usize,
    outputs: usize,
    windows: &mut [i32],
) {
    // SAFETY: there are 1 to POSITIONS tiles, whose sums lie side by side in each product; of the
    // windows the last one used is the second of the last tile, its second output the last number.
    // `Winograd::is_consistent`, which `pool` asserts, keeps the outputs small enough for bytes.
    unsafe {
        tiles_of_pair(
            sums.as_ptr().cast(),
            windows.as_mut_ptr(),
            size_of::<i32>() * outputs,
            OUTPUTS * tiles,
        );
    }
}

/// Two rows of six sums each, transformed back and pooled, for each of `count` (tile, output).
///
/// r0 the sums, r1 the windows, r2 bytes from a window to the next, r3 (tile, output) left; r4-r9 the
/// row, r10 and r11 the largest of both windows, r12 and lr what is needed for a moment.
#[unsafe(naked)]
unsafe extern "C" fn tiles_of_pair(
    sums: *const i32,
    windows: *mut i32,
    outputs: usize,
    count: usize,
) {
    naked_asm!(
        ".macro inward to, x, second, third",
        "ldr \\to, [r0, #(\\x * {sums} + \\second * {row})]",
        "ldr r12, [r0, #(\\x * {sums} + (\\second + 1) * {row})]",
        "ldr lr, [r0, #(\\x * {sums} + (\\second + 2) * {row})]",
        ".if \\third",
        "subs \\to, \\to, r12",
        "subs \\to, \\to, lr",
        ".else",
        "adds \\to, \\to, r12",
        "adds \\to, \\to, lr",
        ".endif",
        ".endm",
        ".macro larger to, other",
        "cmp \\to, \\other",
        "it lt",
        "movlt \\to, \\other",
        ".endm",
        // Six sums in r4-r9 to the largest of two windows: r4 and r6.
        ".macro outward",
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
        "larger r4, r8",
        "larger r6, r5",
        ".endm",
        "push {{r4-r11, lr}}",
        "2:",
        "inward r4, 0, 0, 0",
        "inward r5, 1, 0, 0",
        "inward r6, 2, 0, 0",
        "inward r7, 3, 0, 0",
        "inward r8, 4, 0, 0",
        "inward r9, 5, 0, 0",
        "outward",
        "mov r10, r4",
        "mov r11, r6",
        "inward r4, 0, 1, 1",
        "inward r5, 1, 1, 1",
        "inward r6, 2, 1, 1",
        "inward r7, 3, 1, 1",
        "inward r8, 4, 1, 1",
        "inward r9, 5, 1, 1",
        "outward",
        "larger r4, r10",
        "larger r6, r11",
        "ldr r10, [r1]",
        "ldr r11, [r1, r2]",
        "larger r4, r10",
        "larger r6, r11",
        "str r6, [r1, r2]",
        "str r4, [r1], #4",
        "add r0, #4",
        // Behind a tile's second output the next tile's first window.
        "subs r3, #1",
        "tst r3, #1",
        "ittt eq",
        "addeq r1, r1, r2, lsl #1",
        "subeq r1, #{pair}",
        "cmpeq r3, #0",
        "bne.w 2b",
        "pop {{r4-r11, pc}}",
        ".purgem inward",
        ".purgem larger",
        ".purgem outward",
        sums = const size_of::<Sums>(),
        row = const FREQUENCIES[1] * size_of::<Sums>(),
        pair = const OUTPUTS * size_of::<i32>(),
    );
}

const _: () = assert!(
    WINDOWS == 2 && OUTPUTS == 2,
    "what the assembler is written for"
);
