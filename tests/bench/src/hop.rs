//! Numbers of time steps and windows in an input of the image `encoder`, which counts the
//! instructions of each time step of a hop separately.

use model::{HOP, STEPS};

/// Number of time steps at the start of an input that are not counted, because the encoder's
/// buffers are full only when the second window is complete.
pub const FILLING: usize = STEPS + HOP;

/// Index, within a hop, of the time step that completes a window and its code.
pub const COMPLETING: usize = (STEPS - 1) % HOP;

/// Returns the number of time steps that complete `windows` windows, or two windows if that is
/// more.
///
/// The input file of the image `encoder` starts with this number, 32 bits, little endian. The
/// planes of all inputs follow, one byte per cell. The output file holds the codes in order.
pub const fn steps(windows: usize) -> usize {
    FILLING + HOP * windows.saturating_sub(2)
}

/// Returns the number of complete windows after `steps` time steps, at least [`STEPS`].
pub const fn windows(steps: usize) -> usize {
    (steps - STEPS) / HOP + 1
}

const _: () = assert!(windows(steps(2)) == 2 && windows(steps(9)) == 9);
const _: () = assert!(steps(2) == FILLING && steps(3) == FILLING + HOP);
