//! Dimensions of every model in version 1 of the artifact format.
//!
//! Reading an artifact compares them with its description and the shapes of its tensors.

/// Number of time steps in a window, at 128 Hz.
pub const STEPS: usize = 16;
/// Number of rows of the scalp grid, front to back.
pub const ROWS: usize = 10;
/// Number of columns of the scalp grid, left to right.
pub const COLUMNS: usize = 9;
/// Number of cells in one plane of the scalp grid; a cell without an electrode holds 0.
pub const CELLS: usize = ROWS * COLUMNS;
/// Number of electrodes of the montage; each has one cell of the scalp grid.
pub const ELECTRODES: usize = 61;
/// Length of a code, in numbers.
pub const CODE: usize = 128;
/// Number of values in a window on the scalp grid, in the order step, row, column (the last fastest).
pub const WINDOW_CELLS: usize = STEPS * CELLS;
/// Number of values in a window of electrodes, in the order step, electrode (the last fastest).
pub const WINDOW_ELECTRODES: usize = STEPS * ELECTRODES;
/// Number of output channels of the first convolution.
pub const CONV1_CHANNELS: usize = 16;
/// Number of output channels of the second convolution.
pub const CONV2_CHANNELS: usize = 32;
/// Edge length of every convolution kernel in steps, rows and columns.
pub const KERNEL: usize = 3;
