//! Windows that are computed together as a group, and their layout on the scalp grid.

use crate::dataset::Window;
use crate::layers::{LANES, Lanes, Volume};
use artifact::{Description, Geometry, ScalpGrid};

/// Sizes of the feature maps between the layers, and the grid cell of each electrode.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) geometry: Geometry,
    /// Index of each electrode's cell on the scalp grid.
    cells: Vec<usize>,
}

impl Layout {
    pub(super) fn new(description: &Description) -> Self {
        Self {
            geometry: Geometry::new(description),
            cells: ScalpGrid::new(description).cell_of_electrode().to_vec(),
        }
    }

    /// Puts electrode values (step, electrode) on the scalp grid (step, row, column); cells without
    /// an electrode are 0.
    pub(super) fn scatter(&self, electrodes: &[Lanes]) -> Volume {
        let dimensions = self.geometry.dimensions;
        let size = [dimensions.steps, dimensions.rows, dimensions.columns];
        let mut volume = Volume::zeros(1, size);
        let planes = volume.values.chunks_exact_mut(dimensions.cells());
        for (plane, electrodes) in planes.zip(electrodes.chunks_exact(dimensions.electrodes)) {
            for (&cell, value) in self.cells.iter().zip(electrodes) {
                plane[cell] = *value;
            }
        }
        volume
    }

    /// Returns the electrode values (step, electrode) of a one-channel volume on the scalp grid.
    pub(super) fn gather(&self, volume: &Volume) -> Vec<Lanes> {
        let planes = volume.values.chunks_exact(self.geometry.dimensions.cells());
        planes.flat_map(|plane| self.cells.iter().map(|&cell| plane[cell])).collect()
    }
}

/// Up to [`LANES`] windows; the lanes without a window are 0.
#[derive(Clone, Debug)]
pub(super) struct Group {
    pub(super) windows: usize,
    /// Values on the scalp grid, one channel; cells without an electrode are 0.
    pub(super) cells: Volume,
    /// Values of the electrodes, in the order step, electrode, lane.
    pub(super) electrodes: Vec<Lanes>,
}

impl Group {
    /// Makes a group of at most [`LANES`] windows.
    pub(super) fn new(layout: &Layout, windows: &[&Window]) -> Self {
        let dimensions = layout.geometry.dimensions;
        let electrodes = lanes(windows, dimensions.window_electrodes());
        Self { windows: windows.len(), cells: layout.scatter(&electrodes), electrodes }
    }

    /// Returns the sum of the squared errors of reconstructed electrodes, over all windows.
    pub(super) fn squared_error(&self, window: &[Lanes]) -> f64 {
        let mut sums = [0.0; LANES];
        for (x, y) in self.electrodes.iter().zip(window) {
            for lane in 0..LANES {
                sums[lane] += f64::from(x[lane] - y[lane]).powi(2);
            }
        }
        sums[..self.windows].iter().sum()
    }
}

/// Arranges at most [`LANES`] vectors with `length` elements, one in each lane; other lanes are 0.
pub(super) fn lanes(vectors: &[&[f32]], length: usize) -> Vec<Lanes> {
    let mut values = vec![[0.0; LANES]; length];
    for (lane, vector) in vectors.iter().enumerate() {
        for (lanes, value) in values.iter_mut().zip(*vector) {
            lanes[lane] = *value;
        }
    }
    values
}

/// Returns the values of the first `windows` lanes, one lane after the other.
pub(super) fn by_window(values: &[Lanes], windows: usize) -> Vec<f32> {
    let lanes = 0..windows;
    lanes.flat_map(|lane| values.iter().map(move |lanes| lanes[lane])).collect()
}
