//! Dimensions of the windows and codes of a model, and sizes of the volumes between its layers.

use crate::description::{Description, NetworkShape, Padding};

/// Number of output channels of the first convolution.
pub const CONV1_CHANNELS: usize = 16;
/// Number of output channels of the second convolution.
pub const CONV2_CHANNELS: usize = 32;
/// Edge length of every convolution kernel in steps, rows and columns.
pub const KERNEL: usize = 3;

/// Dimensions of a model's windows and codes, taken from its description.
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
    /// Number of values in a code.
    pub numbers: usize,
}

impl Dimensions {
    /// Returns the number of cells of the scalp grid, including those without an electrode.
    pub const fn cells(&self) -> usize {
        self.rows * self.columns
    }

    /// Returns the number of values in a window on the scalp grid, in the order step, row, column
    /// (the last fastest).
    pub const fn window_cells(&self) -> usize {
        self.steps * self.cells()
    }

    /// Returns the number of values in a window of electrodes, in the order step, electrode (the
    /// last fastest).
    pub const fn window_electrodes(&self) -> usize {
        self.steps * self.electrodes
    }
}

/// Sizes of the volumes between the layers, each in steps, rows, columns. For the paper's windows
/// of 16 x 10 x 9:
///
/// | Padding | after conv1 | after conv2 |
/// | --- | --- | --- |
/// | `none` | 14 x 8 x 7 | 12 x 6 x 5 |
/// | `space` | 14 x 10 x 9 | 12 x 10 x 9 |
/// | `all` | 16 x 10 x 9 | 16 x 10 x 9 |
///
/// A window that is too short, or a grid that is too small, leaves a volume of size 0. Reading or
/// creating an [`Artifact`](crate::Artifact) with convolutions refuses such a description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// Dimensions of window and code.
    pub dimensions: Dimensions,
    /// Zero padding of both convolutions.
    pub padding: Padding,
    /// Size of a max-pool in steps, rows and columns.
    pub pool: [usize; 3],
    /// Size of the first convolution's output.
    pub hidden: [usize; 3],
    /// Size of the second convolution's output, the input of the max-pool.
    pub feature_map: [usize; 3],
    /// Size of the max-pool's output, which drops positions that do not fill a pool.
    pub pooled: [usize; 3],
}

impl Geometry {
    /// Returns the sizes that follow from the description's window, grid, padding and pool.
    ///
    /// # Panics
    /// If a dimension of the pool is 0. Reading or creating an [`Artifact`](crate::Artifact)
    /// refuses such a description.
    pub const fn new(description: &Description) -> Self {
        let dimensions = description.dimensions();
        let NetworkShape { padding, pool } = description.network;
        let Dimensions { steps, rows, columns, .. } = dimensions;
        let hidden = convolved([steps, rows, columns], padding);
        let feature_map = convolved(hidden, padding);
        Self {
            dimensions,
            padding,
            pool,
            hidden,
            feature_map,
            pooled: [feature_map[0] / pool[0], feature_map[1] / pool[1], feature_map[2] / pool[2]],
        }
    }

    /// Returns the number of inputs of the fully connected layer, which are in the order channel,
    /// step, row, column (the last fastest).
    pub const fn flat(&self) -> usize {
        CONV2_CHANNELS * self.pooled[0] * self.pooled[1] * self.pooled[2]
    }
}

/// Returns the size of a convolution's output for an input of `size`; 0 along an axis that is
/// shorter than the kernel after padding.
const fn convolved(size: [usize; 3], padding: Padding) -> [usize; 3] {
    let pads = padding.pads();
    [
        (size[0] + 2 * pads[0]).saturating_sub(KERNEL - 1),
        (size[1] + 2 * pads[1]).saturating_sub(KERNEL - 1),
        (size[2] + 2 * pads[2]).saturating_sub(KERNEL - 1),
    ]
}
