//! The products on a Cortex-M4 or M7, two at a time with SMLAD.
//!
//! Two schedules of the same products: loads in groups, which is the least for a Cortex-M4, or, with
//! the feature `cortex-m7`, each load beside a product, which that core issues together.
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
use crate::Pair;

/// What the assembler works through; it keeps its own copy.
#[repr(C)]
struct Work<const SEGMENTS: usize> {
    /// Next position of each segment.
    inputs: [*const Pair; SEGMENTS],
    weights: *const Pair,
    sums: *mut i32,
    /// Behind the last sum.
    end: *mut i32,
}

/// Does it, if there is assembler for these numbers; slices as long as [`super::dots`] makes them, and
/// at least one step.
#[inline(always)]
pub(super) fn dots<const SEGMENTS: usize, const WIDTH: usize, const STRIDE: usize>(
    inputs: [&[Pair]; SEGMENTS],
    weights: &[Pair],
    is_shared: bool,
    sums: &mut [[i32; POSITIONS * OUTPUTS]],
) -> bool {
    let range = sums.as_mut_ptr_range();
    let work = Work {
        inputs: inputs.map(<[Pair]>::as_ptr),
        weights: weights.as_ptr(),
        sums: range.start.cast(),
        end: range.end.cast(),
    };
    let work = (&raw const work).cast();
    // With the steps that a turn of the loop takes.
    let (kernel, steps): (unsafe extern "C" fn(*const ()), usize) =
        match (SEGMENTS, WIDTH, STRIDE, is_shared) {
            (1, 14, 14, true) => (dots_1x14, 4),
            (3, 8, 8, false) => (dots_3x8, 8),
            (9, 24, 8, true) => (dots_9x24, 1),
            _ => return false,
        };
    if !sums.len().is_multiple_of(steps) {
        return false;
    }
    // SAFETY: a position reads WIDTH inputs of each segment, STRIDE behind the one before, a step
    // OUTPUTS * SEGMENTS * WIDTH weights, and it writes POSITIONS * OUTPUTS sums; `super::dots` cut
    // the slices to as many steps as `sums` has, a whole number of turns and not 0. The match ties
    // each kernel to its `Work`. A pair is an aligned word, as LDRD and LDM want it.
    unsafe { kernel(work) };
    true
}
