//! Where the electrodes are on the scalp grid, and the sizes between the layers.

use crate::layers::Lanes;
use crate::layers::volume::Volume;
use artifact::{Description, Geometry, ScalpGrid};

/// Sizes between the layers, and the cell of each electrode.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) geometry: Geometry,
    /// Cell of the scalp grid of each electrode.
    cells: Vec<usize>,
}

impl Layout {
    pub(super) fn new(description: &Description) -> Self {
        Self {
            geometry: Geometry::new(description),
            cells: ScalpGrid::new(description).cell_of_electrode().to_vec(),
        }
    }

    /// Returns electrodes (step, electrode) on the scalp grid (step, row, column); other cells are 0.
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

    /// Returns the electrodes (step, electrode) of a volume of one channel on the scalp grid.
    pub(super) fn gather(&self, volume: &Volume) -> Vec<Lanes> {
        let planes = volume.values.chunks_exact(self.geometry.dimensions.cells());
        planes
            .flat_map(|plane| self.cells.iter().map(|&cell| plane[cell]))
            .collect()
    }
}
