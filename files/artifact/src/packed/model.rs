//! The integers that encoder and decoder share, and the reference computation with them.

use packed::{Costs, FREQUENCY_BITS, LEVELS, MAGNITUDES, RATES, Starts};
use serde::{Deserialize, Serialize};

/// Fraction bits that the state loses before the prediction, so that sums of products fit 24 bits.
const STATE_BITS: u32 = 3;

/// Dimensions and units of a packed model, and how it was trained: the contents of `packed.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedDescription {
    /// Version of the format, 1.
    pub format: u32,
    /// Number of coefficients of a block: a multiple of 16, at most 256, and at most the values of
    /// a block.
    pub coefficients: usize,
    /// Rate that a device starts with, 0..=15.
    pub rate: u8,
    /// Microvolts of one unit of an input value, and of a coefficient.
    pub unit_uv: f64,
    /// Largest magnitude of an input value; larger ones are clipped to it.
    pub input_limit: i16,
    /// Mean square of the part of a block that its coefficients do not represent, microvolts
    /// squared; a block with more is flagged as a misfit.
    pub misfit_uv2: f64,
    /// Recordings that it was trained on, and its figures on the test recordings.
    pub training: PackedTraining,
}

/// How a packed model was trained.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedTraining {
    /// File names of the training recordings.
    pub train_files: Vec<String>,
    /// File names of the test recordings.
    pub test_files: Vec<String>,
    /// Figures on the test recordings, one entry for each measured rate.
    pub figures: Vec<PackedFigures>,
    /// Figures of the Karhunen-Loeve transform of a block with the same number of coefficients,
    /// trained and coded alike but without prediction; empty without test recordings. Their
    /// `mse_smoothed` equals `mse`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without_prediction: Vec<PackedFigures>,
}

/// Figures of one rate on the test recordings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackedFigures {
    /// The rate, 0..=15.
    pub rate: u8,
    /// Bits of a block, mean.
    pub bits: f64,
    /// Mean squared error of each block as decoded without the next one, in units of the network's
    /// input squared.
    pub mse: f64,
    /// Mean squared error after the smoother has corrected each block by the next one, in the same
    /// unit.
    pub mse_smoothed: f64,
}

/// A trained packed model. Encoder and decoder share every integer of it; only the smoother is the
/// decoder's own.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedModel {
    /// Dimensions and units, and the figures of the training.
    pub description: PackedDescription,
    /// Matrix from the values of a block, in the order step, electrode, to its coefficients.
    pub analysis: IntegerMatrix,
    /// Matrix from the coefficients of the previous state to the prediction of the next block's.
    pub prediction: IntegerMatrix,
    /// Level of each coefficient's mean magnitude at rate 4, 0..64, in a predicted block.
    pub predicted_levels: Vec<u8>,
    /// Level of each coefficient's mean magnitude at rate 4, 0..64, in a block without prediction.
    pub reset_levels: Vec<u8>,
    /// First frequency of each magnitude.
    pub starts: Box<Starts>,
    /// Correction that the decoder adds to a block when the next one has arrived.
    pub smoother: Smoother,
}

impl PackedModel {
    /// Returns the number of coefficients of a block.
    pub fn coefficients(&self) -> usize {
        self.description.coefficients
    }

    /// Returns the coefficients of a block of input values, in the order step, electrode.
    ///
    /// # Panics
    /// If the number of values is not that of a block.
    pub fn analyse(&self, values: &[i16]) -> Vec<i16> {
        self.analysis.multiply(values)
    }

    /// Returns the prediction of the next block's coefficients from the state after a block.
    ///
    /// # Panics
    /// If the number of coefficients differs.
    pub fn predict(&self, state: &[i16]) -> Vec<i16> {
        let rounded: Vec<i16> = state.iter().map(|&s| rounded_state(s)).collect();
        self.prediction.multiply(&rounded)
    }

    /// Returns the bits of each magnitude, 1/16 bit, from their frequencies; the sign included.
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

/// Returns a coefficient of the state as the prediction reads it: divided by 8 and rounded half up,
/// |x| <= 4096.
pub fn rounded_state(coefficient: i16) -> i16 {
    let half = 1 << (STATE_BITS - 1);
    #[expect(clippy::cast_possible_truncation, reason = "an eighth of 16 bits")]
    let rounded = ((i32::from(coefficient) + half) >> STATE_BITS) as i16;
    rounded
}

/// A linear map in integers: `y_j = saturate((sum_i weight_ji * x_i * factor_j + 2^31) >> 32)`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IntegerMatrix {
    /// Weights, -127..=127, `[output][input]`.
    pub weights: Vec<i8>,
    /// Factor of each output, Q0.32.
    pub factors: Vec<i32>,
}

impl IntegerMatrix {
    /// Quantises a matrix `[output][input]`. The weights of each output are scaled to 8 bits, but
    /// by no more than `largest_scale` returns for them; the factors undo the scale, so that the
    /// result equals `matrix * gain`. A factor of 1/2 or more saturates; an artifact with such a
    /// factor is refused.
    pub fn quantised(
        matrix: &[f64],
        inputs: usize,
        gain: f64,
        largest_scale: impl Fn(&[f64]) -> f64,
    ) -> Self {
        let mut quantised = Self::default();
        for row in matrix.chunks_exact(inputs) {
            let largest = row
                .iter()
                .fold(1e-12, |largest: f64, w| largest.max(w.abs()));
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
    /// If the number of inputs is not that of the matrix.
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

    /// Returns the matrix as it maps, `[output][input]`.
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

/// For each rate, a linear estimate of coefficient minus state from the next block's dequantised
/// residual.
///
/// A block's residual depends on the error of the state before it, from which it was predicted. One
/// block later, the reconstruction can therefore remove a part of the error.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoother {
    /// Weights, -127..=127, `[rate][coefficient][residual of the next block]`.
    pub weights: Vec<i8>,
    /// Value of one unit of a weight, `[rate][coefficient]`.
    pub scales: Vec<f32>,
}

impl Smoother {
    /// Quantises the matrices of all rates, ascending, each `[coefficient][residual]`.
    ///
    /// # Panics
    /// If there is not one matrix for each rate.
    pub fn quantised(matrices: &[Vec<f64>], coefficients: usize) -> Self {
        assert_eq!(matrices.len(), RATES, "one matrix for each rate");
        let mut smoother = Self {
            weights: Vec::new(),
            scales: Vec::new(),
        };
        for row in matrices
            .iter()
            .flat_map(|matrix| matrix.chunks_exact(coefficients))
        {
            let largest = row
                .iter()
                .fold(1e-9, |largest: f64, w| largest.max(w.abs()));
            #[expect(clippy::cast_possible_truncation, reason = "at most 127")]
            let weights = row
                .iter()
                .map(|weight| (weight / largest * 127.0).round() as i8);
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
