//! The packed model's integers in the layout that the device reads.

use artifact::{Description, INPUTS_PER_ROUND, IntegerMatrix, PackedModel, slice_ends};
use int8_nn::{Linear, Pair};

use crate::error::ModelGenError;
use crate::headroom::GUARD_BITS;
use crate::layer::to_i32;

/// The packed model, with additional values that the device needs.
#[derive(Clone, Debug)]
pub struct PackedIntegers {
    /// The packed model of the artifact: matrices, levels and frequencies.
    pub model: PackedModel,
    /// Factor, Q0.32, from a filtered sample (counts, Q27.5) to an input value of the packed block.
    pub input_multiplier: i32,
    /// Limit of a block's misfit energy: the sum of squares, in units of an input value, of the
    /// part of the block that the model does not represent. A block above the limit is a misfit.
    /// Negative if errors are weighted; in this case the probes (the last coefficients) serve to
    /// estimate the energy.
    pub misfit_energy: i64,
    /// Number of a block's inputs that the analysis has processed after each step of a hop.
    slices: Vec<usize>,
}

impl PackedIntegers {
    pub(crate) fn new(
        model: &PackedModel,
        description: &Description,
    ) -> Result<Self, ModelGenError> {
        let unit_uv = model.description.unit_uv;
        let factor = description.adc.lsb_uv() / f64::from(1_u32 << GUARD_BITS) / unit_uv;
        let input_multiplier = to_i32(factor * 2_f64.powi(32))
            .filter(|&multiplier| multiplier > 0)
            .ok_or(ModelGenError::InputScale(factor))?;
        let electrodes = description.montage.electrodes.len();
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            reason = "a few hundred values; far below 2^63"
        )]
        let misfit_energy = (model.description.misfit_uv2 / unit_uv.powi(2)
            * (electrodes * description.window.hop) as f64) as i64;
        let is_weighted = model.description.weight.is_some();
        Ok(Self {
            model: model.clone(),
            input_multiplier,
            misfit_energy: if is_weighted { -misfit_energy } else { misfit_energy },
            slices: slice_ends(electrodes, description.window.hop),
        })
    }

    /// Returns the analysis in slices, one for each step of a hop: the index of the slice's first
    /// pair of inputs, and the packed weights of the inputs that the device processes at this step.
    /// Zeros pad the last slice.
    pub fn analysis(&self) -> Vec<(usize, Vec<Pair>)> {
        let mut start = 0;
        let slices = self.slices.iter().map(|&end| {
            let slice = (start / 2, packed(&self.model.analysis, start..end));
            start = end;
            slice
        });
        slices.collect()
    }

    /// Returns the packed weights of the matrix that predicts a block from the state.
    pub fn prediction(&self) -> Vec<Pair> {
        packed(&self.model.prediction, 0..self.model.coefficients())
    }

    /// Returns the number of input pairs of a block, including the zeros that pad the last slice.
    pub fn input_pairs(&self) -> usize {
        self.model.analysis.inputs().next_multiple_of(INPUTS_PER_ROUND) / 2
    }
}

/// Packs the weights of the inputs in the range `inputs` for [`Linear`].
fn packed(matrix: &IntegerMatrix, inputs: std::ops::Range<usize>) -> Vec<Pair> {
    let outputs = matrix.factors.len();
    let weights: Vec<i8> = inputs
        .clone()
        .flat_map(|input| {
            let column = matrix.weights.iter().skip(input).step_by(matrix.inputs());
            column.copied()
        })
        .collect();
    let pairs = inputs.len().next_multiple_of(INPUTS_PER_ROUND) / 2;
    let mut packed = vec![Pair::ZERO; pairs * outputs / 2];
    Linear::pack_weights(pairs, outputs, &weights, &mut packed);
    packed
}
