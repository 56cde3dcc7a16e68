//! The dot products on a Cortex-M4 or M7, two at a time with SMLAD.
//!
//! The same products in two schedules. Grouped loads take the fewest cycles on a Cortex-M4. With the
//! feature `cortex-m7`, each load is paired with a product, because that core issues both together.
#![expect(unsafe_code, reason = "calls the assembler")]

mod arguments;
#[cfg(not(feature = "cortex-m7"))]
mod grouped;
#[cfg(feature = "cortex-m7")]
mod interleaved;

#[cfg(not(feature = "cortex-m7"))]
use grouped::{dots_1x14, dots_3x8, dots_9x24};
#[cfg(feature = "cortex-m7")]
use interleaved::{dots_1x14, dots_3x8, dots_9x24};

use super::layout::{OUTPUTS, POSITIONS};
use crate::pair::Pair;
use arguments::Arguments;

/// Computes the dot products of [`super::dots`] if there is an assembler kernel for these sizes, and
/// returns whether it did. `sums` is not empty, and the slices have the lengths that [`super::dots`]
/// cuts.
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
    // Each kernel with the number of blocks in one iteration of its loop.
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
    // SAFETY: a position reads WIDTH inputs of each segment, STRIDE after those of the position
    // before; a block reads OUTPUTS * SEGMENTS * WIDTH weights and writes POSITIONS * OUTPUTS sums.
    // `super::dots` cut the slices to the number of blocks in `sums`, which is not 0 and a whole
    // number of iterations. The match ties each kernel to its `Arguments`. A pair is an aligned word,
    // as LDRD and LDM require.
    unsafe { kernel(arguments) };
    true
}
