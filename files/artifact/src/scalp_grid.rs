//! Maps electrodes to cells of the scalp grid and back.

use crate::description::Description;
use crate::geometry::Dimensions;

/// The map between electrodes (in ADC channel order) and cells of the scalp grid (row-major).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScalpGrid {
    dimensions: Dimensions,
    cell_of_electrode: Vec<usize>,
}

impl ScalpGrid {
    /// Builds the map from the montage and the grid of a description.
    ///
    /// # Panics
    /// If an electrode of the montage is not on the grid. Reading or creating an
    /// [`Artifact`](crate::Artifact) refuses such a description.
    pub fn new(description: &Description) -> Self {
        let cells: Vec<&String> = description.grid.cells.iter().flatten().collect();
        let cell = |label| {
            cells
                .iter()
                .position(|cell| *cell == label)
                .unwrap_or_else(|| panic!("electrode {label} is not on the grid"))
        };
        Self {
            dimensions: description.dimensions(),
            cell_of_electrode: description.montage.electrodes.iter().map(cell).collect(),
        }
    }

    /// Returns the index `row * columns + column` of the cell of each electrode.
    pub fn cell_of_electrode(&self) -> &[usize] {
        &self.cell_of_electrode
    }

    /// Converts a window of electrodes (step, electrode) to the grid (step, row, column). Cells
    /// without an electrode become 0.
    ///
    /// # Panics
    /// If `electrodes` has fewer values than a window.
    pub fn scatter(&self, electrodes: &[f32]) -> Vec<f32> {
        let mut cells = vec![0.0; self.dimensions.window_cells()];
        for (at_cell, at_electrode) in self.places() {
            cells[at_cell] = electrodes[at_electrode];
        }
        cells
    }

    /// Converts a window on the grid (step, row, column) to its electrodes (step, electrode).
    ///
    /// # Panics
    /// If `cells` has fewer values than a window.
    pub fn gather(&self, cells: &[f32]) -> Vec<f32> {
        self.places().map(|(at_cell, _)| cells[at_cell]).collect()
    }

    /// Returns, for each value of a window in the order step, electrode, its index in a window on
    /// the grid and its index in a window of electrodes.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        let steps = 0..self.dimensions.steps;
        let cells = steps.flat_map(|step| {
            let start = step * self.dimensions.cells();
            self.cell_of_electrode.iter().map(move |cell| start + cell)
        });
        cells.enumerate().map(|(electrode, cell)| (cell, electrode))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    #[expect(clippy::cast_precision_loss, reason = "indices below 2^24")]
    fn gathering_inverts_scattering() {
        let grid = ScalpGrid::new(&testing::description());
        let count = testing::description().dimensions().window_electrodes();
        let window: Vec<f32> = (0..count).map(|index| index as f32).collect();
        assert_eq!(grid.gather(&grid.scatter(&window)), window);
    }

    #[test]
    fn the_first_electrode_of_the_paper_s_grid_is_in_the_third_cell() {
        let grid = ScalpGrid::new(&testing::description());
        assert_eq!(grid.cell_of_electrode()[0], 2);
        let mut window = [0.0; 16 * 61];
        window[3 * 61] = 1.0;
        let cells = grid.scatter(&window);
        assert_eq!(cells.iter().position(|cell| *cell != 0.0), Some(3 * 90 + 2));
    }
}
