//! The map between electrodes and cells of the scalp grid.

use crate::description::Description;
use crate::dimensions::{CELLS, ELECTRODES, STEPS, WINDOW_CELLS, WINDOW_ELECTRODES};

/// The map between electrodes (in ADC channel order) and cells of the scalp grid (row-major).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScalpGrid {
    cell_of_electrode: [usize; ELECTRODES],
}

impl ScalpGrid {
    /// Builds the map from the montage and the grid of a description.
    ///
    /// # Panics
    /// If an electrode of the montage is not on the grid. Reading or creating an
    /// [`Artifact`](crate::Artifact) refuses such a description.
    pub fn new(description: &Description) -> Self {
        let cells: Vec<&String> = description.grid.cells.iter().flatten().collect();
        let cell_of_electrode = core::array::from_fn(|electrode| {
            let label = &description.montage.electrodes[electrode];
            cells
                .iter()
                .position(|cell| *cell == label)
                .unwrap_or_else(|| panic!("electrode {label} is not on the grid"))
        });
        Self { cell_of_electrode }
    }

    /// Returns the cell, row * 9 + column, of each electrode; 0..90.
    pub fn cell_of_electrode(&self) -> &[usize; ELECTRODES] {
        &self.cell_of_electrode
    }

    /// Converts a window of electrodes (step, electrode) to the grid (step, row, column); cells without
    /// an electrode become 0.
    pub fn scatter(&self, electrodes: &[f32; WINDOW_ELECTRODES]) -> Box<[f32; WINDOW_CELLS]> {
        let mut cells = Box::new([0.0; WINDOW_CELLS]);
        for step in 0..STEPS {
            for (electrode, cell) in self.cell_of_electrode.iter().enumerate() {
                cells[step * CELLS + cell] = electrodes[step * ELECTRODES + electrode];
            }
        }
        cells
    }

    /// Converts a window on the grid (step, row, column) to its electrodes (step, electrode).
    pub fn gather(&self, cells: &[f32; WINDOW_CELLS]) -> Box<[f32; WINDOW_ELECTRODES]> {
        let mut electrodes = Box::new([0.0; WINDOW_ELECTRODES]);
        for step in 0..STEPS {
            for (electrode, cell) in self.cell_of_electrode.iter().enumerate() {
                electrodes[step * ELECTRODES + electrode] = cells[step * CELLS + cell];
            }
        }
        electrodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn gathering_inverts_scattering() {
        let grid = ScalpGrid::new(&testing::description());
        let window: [f32; WINDOW_ELECTRODES] = core::array::from_fn(|index| index as f32);
        assert_eq!(*grid.gather(&grid.scatter(&window)), window);
    }

    #[test]
    fn the_first_electrode_of_the_paper_s_grid_is_in_the_third_cell() {
        let grid = ScalpGrid::new(&testing::description());
        assert_eq!(grid.cell_of_electrode()[0], 2);
        let mut window = [0.0; WINDOW_ELECTRODES];
        window[3 * ELECTRODES] = 1.0;
        let cells = grid.scatter(&window);
        assert_eq!(
            cells.iter().position(|cell| *cell != 0.0),
            Some(3 * CELLS + 2)
        );
    }
}
