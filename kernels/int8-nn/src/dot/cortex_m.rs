//! The dot products on a Cortex-M4 or M7, with SMLAD: two products per instruction.
//!
//! There are two schedules with the same results. `grouped` loads several registers at a time,
//! which takes the fewest cycles on a Cortex-M4. `interleaved` (feature `cortex-m7`) alternates
//! loads and products, because a Cortex-M7 issues one of each together. The cycles are computed by
//! llvm-mca, not measured.
#![expect(unsafe_code, reason = "calls the assembler")]

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

/// Arguments of a kernel, which receives their address and copies them to its stack.
#[repr(C)]
struct Arguments<const SEGMENTS: usize> {
    /// Inputs of the next position, in each segment.
    inputs: [*const Pair; SEGMENTS],
    weights: *const Pair,
    sums: *mut i32,
    /// Address after the last sum.
    end: *mut i32,
}

/// Computes the dot products of [`super::dots`] and returns true, or returns false if there is no
/// assembler kernel for these sizes. `sums` must not be empty, and the slices must have the lengths
/// to which [`super::dots`] cuts them.
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
    // For each kernel, the number of blocks that one iteration of its loop computes.
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
    // function returns, and only the kernel uses them. The match passes each kernel the number of
    // segments that it expects. A position reads WIDTH inputs of each segment, STRIDE after those
    // of the previous position; a block reads OUTPUTS * SEGMENTS * WIDTH weights and writes
    // POSITIONS * OUTPUTS sums. `super::dots` cut the slices to the number of blocks in `sums`,
    // which is a whole number of iterations and not 0. A pair is an aligned word, as LDRD and LDM
    // require.
    unsafe { kernel(arguments) };
    true
}
