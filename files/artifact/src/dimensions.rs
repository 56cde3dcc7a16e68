//! Dimensions of a model: its window, scalp grid, electrodes and code.

/// Number of output channels of the first convolution.
pub const CONV1_CHANNELS: usize = 16;
/// Number of output channels of the second convolution.
pub const CONV2_CHANNELS: usize = 32;
/// Edge length of every convolution kernel in steps, rows and columns.
pub const KERNEL: usize = 3;

/// Dimensions of a model, from its description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimensions {
    /// Number of time steps in a window.
    pub steps: usize,
    /// Number of rows of the scalp grid, front to back.
    pub rows: usize,
    /// Number of columns of the scalp grid, left to right.
    pub columns: usize,
    /// Number of electrodes of the montage; each has one cell of the scalp grid.
    pub electrodes: usize,
    /// Number of numbers in a code.
    pub numbers: usize,
}

impl Dimensions {
    /// Returns the number of cells in one plane of the scalp grid; a cell without an electrode holds 0.
    pub const fn cells(&self) -> usize {
        self.rows * self.columns
    }

    /// Returns the number of values in a window on the scalp grid, in the order step, row, column (the
    /// last fastest).
    pub const fn window_cells(&self) -> usize {
        self.steps * self.cells()
    }

    /// Returns the number of values in a window of electrodes, in the order step, electrode (the last
    /// fastest).
    pub const fn window_electrodes(&self) -> usize {
        self.steps * self.electrodes
    }
}
