//! A matrix of 8-bit weights with one factor for each output.

/// A linear map in integers: `y_j = saturate((sum_i weight_ji * x_i * factor_j + 2^31) >> 32)`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IntegerMatrix {
    /// Weights, -127..=127, `[output][input]`.
    pub weights: Vec<i8>,
    /// Factor of each output, Q0.32.
    pub factors: Vec<i32>,
}

impl IntegerMatrix {
    /// Quantises a matrix `[output][input]`. The weights of each output are scaled to 8 bits, but by no more than
    /// `largest_scale` returns for them; the factors undo the scale, so that the result equals `matrix * gain`. A factor of 1/2 or more saturates; an artifact with such a factor is refused.
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

    /// Number of inputs.
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
