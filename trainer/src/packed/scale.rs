//! Integers of the packed model as floats.

use artifact::PackedModel;
use nalgebra::DMatrix;

/// How coefficients become columns of a matrix, in units of `input.sd_uv`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Coefficients of a block.
    pub(super) count: usize,
    /// `input.sd_uv` in one unit of a coefficient.
    unit: f64,
}

impl Scale {
    pub(super) fn new(model: &PackedModel, sd_uv: f64) -> Self {
        Self {
            count: model.coefficients(),
            unit: model.description.unit_uv / sd_uv,
        }
    }

    /// Returns coefficients, block by block, as the columns of a matrix.
    pub(super) fn columns(self, values: &[i16]) -> DMatrix<f32> {
        #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
        let scaled = values
            .iter()
            .map(|&value| (f64::from(value) * self.unit) as f32);
        DMatrix::from_iterator(self.count, values.len() / self.count, scaled)
    }
}
