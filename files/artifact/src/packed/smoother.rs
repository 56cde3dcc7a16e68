//! What the next block says about the quantisation error of a block.

use packed::RATES;

/// For each rate, a linear estimate of coefficient minus state from the next block's dequantised residual.
///
/// A block's residual depends on the error of the state before it, from which it was predicted. One block later,
/// the reconstruction can therefore remove a part of the error.
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
