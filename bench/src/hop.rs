//! The steps of a hop, which the encoder's image counts one by one.

use model::{HOP, STEPS};

/// Steps at the start of an input that are not counted: the first two windows fill the pipeline.
pub const FILLING: usize = STEPS + HOP;

/// Place in the hop of the step that completes a window.
pub const COMPLETING: usize = (STEPS - 1) % HOP;

/// Windows that each step adds itself to: so many products with the shortcut does a step take.
pub const OPEN_WINDOWS: usize = STEPS / HOP;

/// Steps after which so many windows are complete.
///
/// The file with an input says them first, 32 bits, little endian; then comes input by input, plane
/// by plane, cell by cell, one byte each. The image's output is code by code, value by value.
pub const fn steps(windows: usize) -> usize {
    FILLING + HOP * windows.saturating_sub(2)
}

const _: () = assert!(steps(2) == FILLING && steps(3) == FILLING + HOP);
