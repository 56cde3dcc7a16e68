//! Shapes of the encoder's planes and lengths of its weights, derived from the generated constants.

use int8_nn::{InputConv, PlaneShape};

use crate::constants::{
    CODE, COLUMNS, CONV1_CHANNELS, CONV2_CHANNELS, ConvKernel, ELECTRODES, FC_PIECES,
    HAS_CONVOLUTIONS, HAS_SHORTCUT, HOP, PADS_SPACE, PADS_TIME, POOL, ROWS, STEPS,
};

/// Number of steps, rows or columns that an unpadded convolution removes.
const SHRINK: usize = 2;
/// Cells of the scalp grid, row-major; a cell without an electrode is always 0.
pub const CELLS: usize = ROWS * COLUMNS;
/// Number of padding rows and columns on each side of a plane in both convolutions: 0 or 1.
pub const MARGIN: usize = PADS_SPACE as usize;
/// Shape of one time step of the scalp grid, with its margin.
pub const CELL_PLANE: PlaneShape =
    PlaneShape { rows: ROWS + 2 * MARGIN, columns: COLUMNS + 2 * MARGIN, channels: 1 };
/// Rows and columns of the second convolution's output. A network without convolutions has the
/// smallest plane that the kernels accept, so that the shapes of the absent layers are valid on
/// every grid.
const FEATURE_MAP: [usize; 2] = if HAS_CONVOLUTIONS {
    [CELL_PLANE.rows + 2 * MARGIN - 2 * SHRINK, CELL_PLANE.columns + 2 * MARGIN - 2 * SHRINK]
} else {
    [1, 3]
};
/// Shape of a pooled plane, the max-pool's output for the time steps that it combines.
pub const POOLED: PlaneShape = PlaneShape {
    rows: FEATURE_MAP[0] / POOL[1],
    columns: FEATURE_MAP[1] / POOL[2],
    channels: CONV2_CHANNELS,
};
/// Number of pairs of values in a pooled plane.
pub const POOLED_PAIRS: usize = POOLED.len() / 2;
/// Shape of one time step of the first convolution's output. It includes the margin, but not the
/// rows and columns that the pool does not use. In the paper's network one column is left out.
pub const HIDDEN: PlaneShape = PlaneShape {
    rows: POOLED.rows * POOL[1] + SHRINK,
    columns: POOLED.columns * POOL[2] + SHRINK,
    channels: CONV1_CHANNELS,
};
/// Number of pairs of channels in a hidden plane, the output of the first convolution.
pub const HIDDEN_PAIRS: usize = HIDDEN.channels / 2;
/// Shape of a hidden plane without its margin: the part that the first convolution computes.
pub const HIDDEN_INTERIOR: PlaneShape = PlaneShape {
    rows: smaller(HIDDEN.rows - MARGIN, CELL_PLANE.rows.saturating_sub(SHRINK)),
    columns: smaller(HIDDEN.columns - MARGIN, CELL_PLANE.columns.saturating_sub(SHRINK)),
    channels: HIDDEN.channels,
};
/// Number of pooled planes in a window that do not depend on padding; they cover the window less
/// the four steps that two unpadded convolutions remove.
pub const INNER_STEPS: usize = (STEPS - 2 * SHRINK) / POOL[0];
/// Number of pooled planes at each end of a window that depend on padded steps.
pub const EDGE_STEPS: usize = if PADS_TIME { SHRINK / POOL[0] } else { 0 };
/// Number of pooled planes in a window.
pub const POOLED_STEPS: usize = if HAS_CONVOLUTIONS { INNER_STEPS + 2 * EDGE_STEPS } else { 0 };
/// Largest number of windows that contain the same time step.
pub const OPEN_WINDOWS: usize = STEPS / HOP;
/// Whether the model has a network. Without a network, it has the packed code alone, and its codes
/// have no values.
pub const HAS_NETWORK: bool = HAS_CONVOLUTIONS || HAS_SHORTCUT;
/// Number of matrices of the linear shortcut: one per time step of a window; 0 without a shortcut.
pub const SHORTCUT_STEPS: usize = if HAS_SHORTCUT { STEPS } else { 0 };
/// Number of pairs of electrodes in a time step, padded with zeros to a multiple of eight.
pub const ELECTRODE_PAIRS: usize = ELECTRODES.div_ceil(2).next_multiple_of(8);
/// Number of outputs of a matrix with one output for each electrode, padded with unused outputs to
/// a multiple of four.
pub const ELECTRODE_OUTPUTS: usize = ELECTRODES.next_multiple_of(4);

const fn smaller(a: usize, b: usize) -> usize {
    if a < b { a } else { b }
}

/// Kernel of the second convolution and its pool, for the shape of a hidden plane.
pub type Conv2<'w> = ConvKernel<'w, HIDDEN_PAIRS, { HIDDEN.columns }>;

/// Number of output channels of the first convolution; 0 in a network without convolutions.
pub const CONV1_OUTPUTS: usize = if HAS_CONVOLUTIONS { HIDDEN.channels } else { 0 };
/// Number of output channels of the second convolution; 0 in a network without convolutions.
pub const CONV2_OUTPUTS: usize = if HAS_CONVOLUTIONS { POOLED.channels } else { 0 };
/// Number of pairs in the packed weights of the first convolution.
pub const CONV1_PAIRS: usize = InputConv::<{ CELL_PLANE.columns }>::weights_len(CONV1_OUTPUTS);
/// Number of pairs in the packed weights of the second convolution.
pub const CONV2_PAIRS: usize = Conv2::weights_len(CONV2_OUTPUTS);
/// Number of pairs of inputs of one matrix of the fully connected layer.
pub(crate) const FC_INPUTS: usize = POOLED_PAIRS / FC_PIECES;
/// Number of pairs in the packed weights of one matrix of the fully connected layer.
pub const FC_PAIRS: usize = FC_INPUTS * CODE / 2;
/// Number of pairs in the packed weights of one matrix of the linear shortcut.
pub const SHORTCUT_PAIRS: usize = ELECTRODE_PAIRS * CODE / 2;
