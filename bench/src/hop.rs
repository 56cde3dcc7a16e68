//! Time steps of a hop: the encoder's image counts each of them separately.

use model::{HOP, STEPS};

/// Number of time steps at the start of an input that are not counted, because the first two
/// windows fill the encoder.
pub const FILLING: usize = STEPS + HOP;

/// Index in the hop of the time step that completes a window.
pub const COMPLETING: usize = (STEPS - 1) % HOP;

/// Number of time steps after which `windows` windows are complete.
///
/// The encoder's input file starts with this number, 32 bits, little endian. The planes of all inputs follow,
/// one byte per cell. The output file holds the codes in order.
pub const fn steps(windows: usize) -> usize {
    FILLING + HOP * windows.saturating_sub(2)
}

/// Number of complete windows after `steps` time steps, at least [`STEPS`] of them.
pub const fn windows(steps: usize) -> usize {
    (steps - STEPS) / HOP + 1
}

const _: () = assert!(windows(steps(2)) == 2 && windows(steps(9)) == 9);
const _: () = assert!(steps(2) == FILLING && steps(3) == FILLING + HOP);
