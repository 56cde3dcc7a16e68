//! Reconstruction error of each electrode.

use crate::dataset::Window;
use crate::evaluate::CodedBlock;
use artifact::{Description, ScalpGrid};

/// Errors of one electrode over all measured windows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ElectrodeError {
    pub(crate) label: String,
    /// Row and column of the electrode's cell on the scalp grid, from 0; the first row is at the
    /// front of the head, the first column on the left.
    pub(crate) cell: [usize; 2],
    /// Whether all recordings have the electrode; false if it is interpolated in at least one.
    pub(crate) is_recorded: bool,
    /// Mean squared error with float codes, in units of `input.sd_uv` squared.
    pub(crate) mse_float: f64,
    /// Mean squared error with integer codes, in units of `input.sd_uv` squared.
    pub(crate) mse_int8: f64,
}

/// Sums of squared errors of each electrode.
#[derive(Clone, Debug)]
pub(crate) struct ElectrodeSums {
    /// Sums of squared errors with float codes and with integer codes, for each electrode.
    squares: Vec<[f64; 2]>,
    /// Number of time steps over which the errors are summed.
    steps: usize,
}

impl ElectrodeSums {
    pub(crate) fn new(electrodes: usize) -> Self {
        Self { squares: vec![[0.0; 2]; electrodes], steps: 0 }
    }

    /// Adds the errors of a block of windows to the sums.
    pub(crate) fn add(&mut self, block: &CodedBlock) {
        let window = block.windows.first().map_or(1, |window| window.len());
        let float = block.decoded.chunks_exact(window);
        let windows = float.zip(block.decoded_received.chunks_exact(window));
        for (window, (float, integer)) in block.windows.iter().zip(windows) {
            self.add_window(window, float, integer);
        }
    }

    fn add_window(&mut self, window: &Window, float: &[f32], integer: &[f32]) {
        let electrodes = self.squares.len();
        let decoded = float.chunks_exact(electrodes).zip(integer.chunks_exact(electrodes));
        for (original, (float, integer)) in window.chunks_exact(electrodes).zip(decoded) {
            for (electrode, [of_float, of_integer]) in self.squares.iter_mut().enumerate() {
                *of_float += f64::from(original[electrode] - float[electrode]).powi(2);
                *of_integer += f64::from(original[electrode] - integer[electrode]).powi(2);
            }
            self.steps += 1;
        }
    }

    /// Returns the mean errors of each electrode of the montage in `description`. `is_recorded`
    /// returns whether an electrode was recorded in every recording.
    pub(crate) fn errors(
        &self,
        description: &Description,
        is_recorded: impl Fn(&String) -> bool,
    ) -> Vec<ElectrodeError> {
        let steps = self.steps as f64;
        let grid = ScalpGrid::new(description);
        let columns = description.dimensions().columns;
        let labels = description.montage.electrodes.iter();
        labels
            .zip(grid.cell_of_electrode())
            .zip(&self.squares)
            .map(|((label, cell), [float, integer])| ElectrodeError {
                label: label.clone(),
                cell: [cell / columns, cell % columns],
                is_recorded: is_recorded(label),
                mse_float: float / steps,
                mse_int8: integer / steps,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn the_error_of_an_electrode_is_the_mean_over_its_values_alone() {
        let description = testing::description();
        let electrodes = description.montage.electrodes.len();
        let dimensions = description.dimensions();
        let window = vec![0.0; dimensions.window_electrodes()];
        let (mut float, mut integer) = (window.clone(), window.clone());
        // The first window is wrong at electrode 3 in two time steps if decoded from float codes.
        // The second is wrong at electrode 5 in one time step if decoded from integer codes.
        float[3] = 2.0;
        float[7 * electrodes + 3] = -1.0;
        integer[4 * electrodes + 5] = 3.0;
        let mut sums = ElectrodeSums::new(electrodes);
        sums.add(&CodedBlock {
            windows: &[&window, &window],
            decoded: &[float, window.clone()].concat(),
            decoded_received: &[window.clone(), integer].concat(),
        });
        let is_recorded = |label: &String| *label != description.montage.electrodes[5];
        let errors = sums.errors(&description, is_recorded);
        let steps = 2.0 * dimensions.steps as f64;
        for (electrode, error) in errors.iter().enumerate() {
            let [row, column] = error.cell;
            assert_eq!(description.grid.cells[row][column], error.label);
            assert_eq!(error.is_recorded, electrode != 5);
            let expected = match electrode {
                3 => [5.0, 0.0],
                5 => [0.0, 9.0],
                _ => [0.0, 0.0],
            };
            for (mse, sum) in [error.mse_float, error.mse_int8].iter().zip(expected) {
                assert!((mse - sum / steps).abs() < 1e-12, "{error:?}");
            }
        }
    }
}
