//! Numbering of the time steps in a hop. The image of the encoder counts the instructions of each
//! of them separately.

use model::{HOP, STEPS};

/// Number of time steps at the start of an input that are not counted: those of the first two
/// windows, in which the encoder's buffers fill.
pub const FILLING: usize = STEPS + HOP;

/// Index, within a hop, of the time step that completes a window.
pub const COMPLETING: usize = (STEPS - 1) % HOP;

/// Returns the number of time steps that complete `windows` windows, at least two.
///
/// The input file of the encoder's image starts with this number, 32 bits, little endian. The
/// planes of all inputs follow, one byte per cell. The output file holds the codes in order.
pub const fn steps(windows: usize) -> usize {
    FILLING + HOP * windows.saturating_sub(2)
}

/// Returns the number of complete windows after `steps` time steps, which must be at least
/// [`STEPS`].
pub const fn windows(steps: usize) -> usize {
    (steps - STEPS) / HOP + 1
}

const _: () = assert!(windows(steps(2)) == 2 && windows(steps(9)) == 9);
const _: () = assert!(steps(2) == FILLING && steps(3) == FILLING + HOP);
