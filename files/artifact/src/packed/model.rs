//! The integers that the packed code's encoder and decoder share, and reference computations.

use crate::description::Person;
use packed::{Costs, FREQUENCY_BITS, LEVELS, MAGNITUDES, RATES, Starts};
use serde::{Deserialize, Serialize};

/// Number of fraction bits that prediction drops from the state, so that sums of products fit 24
/// bits.
const STATE_BITS: u32 = 3;

/// Dimensions, units and training of a packed model: the contents of `packed.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedDescription {
    /// Version of the file format, always 1.
    pub format: u32,
    /// Number of coefficients of a block: a multiple of 16, at most 256 and at most the block's
    /// values.
    pub coefficients: usize,
    /// Rate of the packed code with which a device starts, 0 (finest) to 15 (coarsest).
    pub rate: u8,
    /// Microvolts per unit of an input value or a coefficient.
    pub unit_uv: f64,
    /// Largest magnitude of an input value; larger ones are clipped to it.
    pub input_limit: i16,
    /// Largest mean square, in microvolts squared, of the part of a block that its coefficients do
    /// not represent. A block above this limit is flagged as a misfit.
    pub misfit_uv2: f64,
    /// Error weighting with which the transform was trained; `None` if all errors have equal
    /// weight. A weighted model has its own [synthesis](PackedModel::synthesis), and its last
    /// [`packed::PROBES`] coefficients are probes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<ErrorWeight>,
    /// Training recordings, test recordings and test results.
    pub training: PackedTraining,
}

/// Additional weight of the errors in a frequency band, after spatial whitening.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorWeight {
    /// Lower and upper edge of the band, Hz; 1 <= low < high <= 60.
    pub band_hz: [f64; 2],
    /// Weight of errors in the band, added to the weight 1 at all frequencies; above 0, no unit.
    pub strength: f64,
}

/// The recordings that trained and tested a packed model, and the results.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedTraining {
    /// File names of the training recordings.
    pub train_files: Vec<String>,
    /// File names of the test recordings.
    pub test_files: Vec<String>,
    /// People whose recordings trained the model, if there are several or one has bad electrodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub people: Vec<Person>,
    /// Length and error on the test recordings, one entry for each measured rate.
    pub figures: Vec<PackedFigures>,
    /// Figures of a Karhunen-Loeve transform of each block, for comparison. This transform has as
    /// many coefficients as the model, and the same training and coding, but no prediction from the
    /// previous block. In these figures, `mse_smoothed` equals `mse`. Empty without test
    /// recordings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without_prediction: Vec<PackedFigures>,
}

/// Length and error of the packed code on the test recordings, at one rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedFigures {
    /// Rate at which length and error were measured, 0 (finest) to 15 (coarsest).
    pub rate: u8,
    /// Mean length of a block in bits.
    pub bits: f64,
    /// Mean squared error of blocks decoded without the next block, in units of `input.sd_uv`
    /// squared.
    pub mse: f64,
    /// Mean squared error after the smoother has corrected each block with the next one, in units
    /// of `input.sd_uv` squared.
    pub mse_smoothed: f64,
}

/// A trained packed model. Encoder and decoder share all its integers. Only the decoder needs the
/// smoother and the synthesis.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedModel {
    /// Dimensions, units and test results.
    pub description: PackedDescription,
    /// Matrix that maps the values of a block, in the order step, electrode, to its coefficients.
    pub analysis: IntegerMatrix,
    /// Matrix that maps the state after a block to the prediction of the next block's coefficients.
    pub prediction: IntegerMatrix,
    /// Mean magnitude of each coefficient at rate 4 in a predicted block, as a logarithmic level,
    /// 0..64.
    pub predicted_levels: Vec<u8>,
    /// Mean magnitude of each coefficient at rate 4 in a block without prediction, as a logarithmic
    /// level, 0..64.
    pub reset_levels: Vec<u8>,
    /// First frequency of each magnitude in the range coder (cumulative frequency).
    pub starts: Box<Starts>,
    /// Correction that the decoder adds to a block when the next block has arrived.
    pub smoother: Smoother,
    /// Matrix that maps coefficients to values, `[coefficient][value]`: the values with the least
    /// weighted energy that have these coefficients. `None` if the model has no weight; decoders
    /// then use the pseudoinverse of the analysis.
    pub synthesis: Option<Vec<f32>>,
}

impl PackedModel {
    /// Returns the number of coefficients of a block.
    pub fn coefficients(&self) -> usize {
        self.description.coefficients
    }

    /// Returns the coefficients of a block, whose `values` are in the order step, electrode.
    ///
    /// # Panics
    /// If the number of values is not the number of values in a block.
    pub fn analyse(&self, values: &[i16]) -> Vec<i16> {
        self.analysis.multiply(values)
    }

    /// Predicts the next block's coefficients from the state after the current block.
    ///
    /// # Panics
    /// If `state` does not have one number for each coefficient.
    pub fn predict(&self, state: &[i16]) -> Vec<i16> {
        let rounded: Vec<i16> = state.iter().map(|&s| rounded_state(s)).collect();
        self.prediction.multiply(&rounded)
    }

    /// Returns the code length of each magnitude with its sign, in 1/16 bit.
    pub fn costs(&self) -> Box<Costs> {
        let mut costs = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
        let rows = self.starts.iter().flatten();
        for (costs, starts) in costs.iter_mut().flatten().zip(rows) {
            let ends = starts[1..].iter().copied().chain([1 << FREQUENCY_BITS]);
            for (magnitude, (start, end)) in starts.iter().zip(ends).enumerate() {
                let count = f64::from(end.saturating_sub(*start).max(1));
                let sign = f64::from(u8::from(magnitude > 0));
                let bits = f64::from(FREQUENCY_BITS) - count.log2() + sign;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "0 to 255"
                )]
                let sixteenths = (bits * 16.0).round().min(255.0) as u8;
                costs[magnitude] = sixteenths;
            }
        }
        costs
    }
}

/// Returns a coefficient of the state as used for the prediction: divided by 8, rounded half up.
/// The magnitude is at most 4096.
pub fn rounded_state(coefficient: i16) -> i16 {
    let half = 1 << (STATE_BITS - 1);
    #[expect(clippy::cast_possible_truncation, reason = "an eighth of 16 bits")]
    let rounded = ((i32::from(coefficient) + half) >> STATE_BITS) as i16;
    rounded
}

/// A linear map in integers: `y_j = saturate((sum_i weight_ji * x_i * factor_j + 2^31) >> 32)`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IntegerMatrix {
    /// Weights, -127..=127, in the order `[output][input]`.
    pub weights: Vec<i8>,
    /// Factor that scales each output's sum, Q0.32.
    pub factors: Vec<i32>,
}

impl IntegerMatrix {
    /// Quantises `matrix * gain`; `matrix` is `[output][input]`. Each output's weights are
    /// multiplied by the largest scale with which they fit 8 bits, but at most by
    /// `largest_scale(weights)`. The output's factor undoes the scale. A factor of 1/2 or more
    /// saturates, and an artifact with such a factor is refused.
    pub fn quantised(
        matrix: &[f64],
        inputs: usize,
        gain: f64,
        largest_scale: impl Fn(&[f64]) -> f64,
    ) -> Self {
        let mut quantised = Self::default();
        for row in matrix.chunks_exact(inputs) {
            let largest = row.iter().fold(1e-12, |largest: f64, w| largest.max(w.abs()));
            let scale = (127.0 / largest).min(largest_scale(row));
            #[expect(clippy::cast_possible_truncation, reason = "at most 127")]
            let weights = row.iter().map(|weight| (weight * scale).round() as i8);
            quantised.weights.extend(weights);
            #[expect(clippy::cast_possible_truncation, reason = "saturates")]
            let factor = (gain / scale * 2_f64.powi(32)).round() as i32;
            quantised.factors.push(factor);
        }
        quantised
    }

    /// Returns the number of inputs of the matrix.
    pub fn inputs(&self) -> usize {
        self.weights.len() / self.factors.len().max(1)
    }

    /// Returns the outputs for `inputs`, each saturated to 16 bits.
    ///
    /// # Panics
    /// If the number of `inputs` is not [`Self::inputs`].
    pub fn multiply(&self, inputs: &[i16]) -> Vec<i16> {
        assert_eq!(inputs.len(), self.inputs(), "inputs of the matrix");
        let rows = self.weights.chunks_exact(inputs.len().max(1));
        rows.zip(&self.factors)
            .map(|(weights, &factor)| {
                let products = weights.iter().zip(inputs);
                let sum: i32 = products.map(|(&w, &x)| i32::from(w) * i32::from(x)).sum();
                requantised(sum, factor)
            })
            .collect()
    }

    /// Returns the matrix that weights and factors represent, `[output][input]`.
    pub fn to_float(&self) -> Vec<f64> {
        let rows = self.weights.chunks_exact(self.inputs().max(1));
        rows.zip(&self.factors)
            .flat_map(|(weights, &factor)| {
                let factor = f64::from(factor) / 2_f64.powi(32);
                weights.iter().map(move |&w| f64::from(w) * factor)
            })
            .collect()
    }
}

/// Returns `sum * factor / 2^32`, rounded half up and saturated to 16 bits.
fn requantised(sum: i32, factor: i32) -> i16 {
    let product = i64::from(sum) * i64::from(factor) + (1 << 31);
    let rounded = (product >> 32).clamp(i16::MIN.into(), i16::MAX.into());
    #[expect(clippy::cast_possible_truncation, reason = "clamped to 16 bits")]
    let saturated = rounded as i16;
    saturated
}

/// For each rate, a linear map from the dequantised residual of the next block to an estimate of
/// this block's error. The error is the block's true coefficients minus its decoded coefficients,
/// which are the state.
///
/// A block is predicted from the state after the previous block, so its residual depends on the
/// error of that state. One block later, the decoder can therefore remove a part of this error.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoother {
    /// Weights, -127..=127, `[rate][coefficient][residual of the next block]`.
    pub weights: Vec<i8>,
    /// Factor that scales the integer weights of a row, `[rate][coefficient]`.
    pub scales: Vec<f32>,
}

impl Smoother {
    /// Quantises one matrix for each rate, in ascending order of rates, each
    /// `[coefficient][residual]`.
    ///
    /// # Panics
    /// If there is not one matrix for each rate.
    pub fn quantised(matrices: &[Vec<f64>], coefficients: usize) -> Self {
        assert_eq!(matrices.len(), RATES, "one matrix for each rate");
        let mut smoother = Self { weights: Vec::new(), scales: Vec::new() };
        for row in matrices.iter().flat_map(|matrix| matrix.chunks_exact(coefficients)) {
            let largest = row.iter().fold(1e-9, |largest: f64, w| largest.max(w.abs()));
            #[expect(clippy::cast_possible_truncation, reason = "at most 127")]
            let weights = row.iter().map(|weight| (weight / largest * 127.0).round() as i8);
            smoother.weights.extend(weights);
            #[expect(clippy::cast_possible_truncation, reason = "stored as f32")]
            smoother.scales.push((largest / 127.0) as f32);
        }
        smoother
    }

    /// Returns the matrix of a rate as floats, `[coefficient][residual of the next block]`.
    ///
    /// # Panics
    /// If the rate is above 15.
    pub fn matrix(&self, rate: u8) -> Vec<f32> {
        let coefficients = self.scales.len() / RATES;
        let rate = usize::from(rate);
        let scales = &self.scales[rate * coefficients..][..coefficients];
        let weights = &self.weights[rate * coefficients * coefficients..];
        scales
            .iter()
            .zip(weights.chunks_exact(coefficients.max(1)))
            .flat_map(|(scale, weights)| weights.iter().map(move |&w| f32::from(w) * scale))
            .collect()
    }
}
