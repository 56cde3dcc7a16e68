use crate::description::Description;
use crate::shapes::{CELLS, ELECTRODES, STEPS, WINDOW_CELLS, WINDOW_ELECTRODES};

/// Label of a cell that no electrode lies on.
pub(crate) const EMPTY: &str = "_";

/// The map between electrodes (in ADC channel order) and cells of the scalp grid (row-major).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScalpGrid {
    cell_of_electrode: [usize; ELECTRODES],
}

impl ScalpGrid {
    /// The map that a description holds.
    ///
    /// # Panics
    /// When an electrode of the montage is not on the grid. No [`crate::Artifact`] holds such a
    /// description: reading and making one refuse it.
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

    /// The cell (row * 9 + column, 0..90) of each electrode.
    pub fn cell_of_electrode(&self) -> &[usize; ELECTRODES] {
        &self.cell_of_electrode
    }

    /// Lays a window of electrodes (step, electrode) on the grid (step, row, column); empty cells
    /// hold 0.
    pub fn scatter(&self, electrodes: &[f32; WINDOW_ELECTRODES]) -> Box<[f32; WINDOW_CELLS]> {
        let mut cells = Box::new([0.0; WINDOW_CELLS]);
        for step in 0..STEPS {
            for (electrode, cell) in self.cell_of_electrode.iter().enumerate() {
                cells[step * CELLS + cell] = electrodes[step * ELECTRODES + electrode];
            }
        }
        cells
    }

    /// Takes the electrodes (step, electrode) out of a window on the grid (step, row, column).
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
    fn scattering_then_gathering_gives_the_window_back() {
        let grid = ScalpGrid::new(&testing::description());
        let window: [f32; WINDOW_ELECTRODES] = core::array::from_fn(|index| index as f32);
        assert_eq!(*grid.gather(&grid.scatter(&window)), window);
    }

    #[test]
    fn the_first_electrode_of_the_paper_lies_in_the_third_cell() {
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
