//! The dot products on a Cortex-M4 or M7, where SMLAD computes two products per instruction.
//!
//! There are two schedules (orders of instructions) with the same results. `grouped` loads several
//! registers at a time, which takes the fewest cycles on a Cortex-M4. `interleaved` (feature
//! `cortex-m7`) alternates loads and products, because a Cortex-M7 can issue a load and a product
//! together. The cycles were predicted by llvm-mca, not measured.
#![expect(
    unsafe_code,
    reason = "LLVM does not generate SMLAD from Rust, and the loop needs every register"
)]

/// Defines the kernel `$name` for a number of segments, a width and a stride; `$shared` says
/// whether all blocks use the same weights. One iteration computes `$blocks` blocks, and updates
/// the pointers on the stack once.
///
/// The four lists are the instructions of a schedule: at the start of a block, at the start of a
/// segment, in each round, and at the end of a block, where lr moves to the weights of the next
/// block.
///
/// r0-r5: sums; r6-r9: weights of a round (two words of the first output, two of the second);
/// r10-r11: inputs of a position; r12: next position of a segment; lr: weights. Pointers for which
/// no register is left stay on the stack.
macro_rules! kernel {
    ($name:ident, $segments:literal, $width:literal, $stride:literal, $blocks:literal, $shared:literal,
        [$($start:literal,)*] [$($segment:literal,)*] [$($round:literal,)*] [$($end:literal,)*]) => {
        #[unsafe(naked)]
        pub(super) unsafe extern "C" fn $name(arguments: *const ()) {
            core::arch::naked_asm!(
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
                $($start,)*
                ".set segment, 0",
                ".rept {segments}",
                "ldr r12, [sp, #(4 * segment)]",
                $($segment,)*
                ".set round, 0",
                ".rept {rounds}",
                $($round,)*
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
                $($end,)*
                ".set block, block + 1",
                ".endr",
                "ldr r11, [sp, #{end}]",
                "cmp r12, r11",
                "bne.w 2b",
                "add sp, #{frame}",
                "pop {{r4-r11, pc}}",
                segments = const $segments,
                blocks = const $blocks,
                rounds = const $width / crate::dot::ROUND,
                position = const 4 * $stride,
                frame = const size_of::<super::Arguments<$segments>>(),
                weights = const core::mem::offset_of!(super::Arguments<$segments>, weights),
                sums = const core::mem::offset_of!(super::Arguments<$segments>, sums),
                shared = const $shared as usize,
                weights_of_block = const 4 * crate::dot::weights_len($segments * $width),
                end = const core::mem::offset_of!(super::Arguments<$segments>, end),
            );
        }
    };
}

/// Defines all kernels with one schedule, given as the four lists of instructions for [`kernel`].
macro_rules! schedule {
    ($start:tt $segment:tt $round:tt $end:tt) => {
        kernel!(dots_1x14, 1, 14, 14, 4, true, $start $segment $round $end);
        kernel!(dots_3x8, 3, 8, 8, 8, false, $start $segment $round $end);
        kernel!(dots_9x24, 9, 24, 8, 1, true, $start $segment $round $end);
    };
}

#[cfg(not(feature = "cortex-m7"))]
mod grouped;
#[cfg(feature = "cortex-m7")]
mod interleaved;

#[cfg(not(feature = "cortex-m7"))]
use grouped::{dots_1x14, dots_3x8, dots_9x24};
#[cfg(feature = "cortex-m7")]
use interleaved::{dots_1x14, dots_3x8, dots_9x24};

use super::{OUTPUTS, POSITIONS};
use crate::pair::Pair;

/// Arguments of a kernel, which receives the address of this struct and copies it to its stack.
#[repr(C)]
struct Arguments<const SEGMENTS: usize> {
    /// For each segment, pointer to the first input of the next position.
    inputs: [*const Pair; SEGMENTS],
    weights: *const Pair,
    sums: *mut i32,
    /// Address after the last sum, at which the kernel stops.
    end: *mut i32,
}

/// Computes the dot products of [`super::dots`] and returns true, or returns false if there is no
/// assembler kernel for these sizes. `sums` must not be empty, and the slices must have exactly the
/// lengths to which [`super::dots`] cuts them.
#[inline(always)]
pub(super) fn dots<const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
    inputs: [&[Pair]; SEGMENTS],
    weights: &[Pair],
    is_shared: bool,
    sums: &mut [[i32; POSITIONS * OUTPUTS]],
) -> bool {
    let range = sums.as_mut_ptr_range();
    let arguments = Arguments {
        inputs: inputs.map(<[Pair]>::as_ptr),
        weights: weights.as_ptr(),
        sums: range.start.cast(),
        end: range.end.cast(),
    };
    let arguments = (&raw const arguments).cast();
    // Each kernel comes with the number of blocks that one iteration of its loop computes.
    let (kernel, blocks): (unsafe extern "C" fn(*const ()), usize) =
        match (SEGMENTS, WIDTH, STRIDE, is_shared) {
            (1, 14, 14, true) => (dots_1x14, 4),
            (3, 8, 8, false) => (dots_3x8, 8),
            (9, 24, 8, true) => (dots_9x24, 1),
            _ => return false,
        };
    if !sums.len().is_multiple_of(blocks) {
        return false;
    }
    // SAFETY: `arguments` points to the `Arguments` above, which lives until this function returns;
    // the kernel only reads it. The pointers in it come from slices that are borrowed until this
    // function returns, and only the kernel uses them. The match selects a kernel for this number
    // of segments. A position reads WIDTH inputs of each segment, STRIDE after the inputs of the
    // previous position; a block reads OUTPUTS * SEGMENTS * WIDTH weights and writes POSITIONS *
    // OUTPUTS sums. `super::dots` has cut the slices to the number of blocks in `sums`, which is
    // not 0 and a whole number of iterations. A pair is an aligned word, as LDRD and LDM require.
    unsafe { kernel(arguments) };
    true
}
