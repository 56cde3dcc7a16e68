//! Quantisation of a weight matrix, row by row.

use crate::{
    error::ModelGenError,
    rounding::{to_i32, weights_i8},
};

/// Quantisation of a layer's input: `value = integer * scale`, |integer| <= `largest`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerInput {
    pub(crate) scale: f64,
    pub(crate) largest: f64,
}

/// A float layer: weights `[output][input]`, one bias and one gain for each output.
pub(crate) struct FloatLayer<'f> {
    pub(crate) name: &'static str,
    pub(crate) weights: &'f [f64],
    pub(crate) bias: &'f [f64],
    /// Levels of the quantised output for a layer value of 1; can be negative.
    pub(crate) gain: &'f [f64],
}

/// A quantised layer: weights, biases in units of the accumulator, requantisation factors in Q0.32.
#[derive(Debug, Default)]
pub(crate) struct IntegerLayer {
    pub(crate) weights: Vec<i8>,
    pub(crate) bias: Vec<i32>,
    pub(crate) multipliers: Vec<i32>,
}

impl FloatLayer<'_> {
    /// Quantises every row with its own scale, and proves that the accumulator and the factor of the row
    /// fit 32 bits.
    pub(crate) fn quantise(&self, input: LayerInput) -> Result<IntegerLayer, ModelGenError> {
        let mut integers = IntegerLayer::default();
        let inputs = self.weights.len() / self.bias.len();
        for (output, row) in self.weights.chunks_exact(inputs).enumerate() {
            let (bias, gain) = (self.bias[output], self.gain[output]);
            let (weights, scale) = weights_i8(row, finest_scale(bias, gain, input));
            let unit = input.scale * scale;
            integers
                .bias
                .push(self.bias(output, &weights, bias / unit, input.largest)?);
            integers
                .multipliers
                .push(self.multiplier(output, gain * unit)?);
            integers.weights.extend(weights);
        }
        Ok(integers)
    }

    /// Returns the bias in units of the accumulator, or an error if an input could overflow the 32-bit
    /// accumulator.
    fn bias(
        &self,
        output: usize,
        weights: &[i8],
        bias: f64,
        largest: f64,
    ) -> Result<i32, ModelGenError> {
        let weights: f64 = weights.iter().map(|&w| f64::from(w).abs()).sum();
        let worst = weights * largest + bias.abs();
        to_i32(bias)
            .filter(|_| worst < f64::from(i32::MAX))
            .ok_or(ModelGenError::Accumulator {
                layer: self.name,
                output,
                worst,
            })
    }

    fn multiplier(&self, output: usize, factor: f64) -> Result<i32, ModelGenError> {
        to_i32(factor * 4_294_967_296.0).ok_or(ModelGenError::Multiplier {
            layer: self.name,
            output,
            factor,
        })
    }
}

/// Returns the smallest permitted weight scale. With this scale, the magnitude of the requantisation
/// factor is at least 2^8 (unless the gain is 0) and that of the bias at most 2^24, so that an output
/// with negligible weights can still be represented.
fn finest_scale(bias: f64, gain: f64, input: LayerInput) -> f64 {
    const TWO_TO_24: f64 = 16_777_216.0;
    let output_level = if gain == 0.0 { 0.0 } else { 1.0 / gain.abs() };
    (bias.abs().max(output_level) / (input.scale * TWO_TO_24)).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUT: LayerInput = LayerInput {
        scale: 0.1,
        largest: 128.0,
    };

    fn quantise(weights: &[f64], bias: f64, gain: f64) -> Result<IntegerLayer, ModelGenError> {
        FloatLayer {
            name: "test",
            weights,
            bias: &[bias],
            gain: &[gain],
        }
        .quantise(INPUT)
    }

    #[test]
    fn a_quantised_row_is_within_half_a_level_of_the_float_row() {
        let layer = quantise(&[0.5, -1.0], 3.0, 2.0).expect("an ordinary row");
        let x = [100, -50];
        let sum: i32 = layer
            .weights
            .iter()
            .zip(x)
            .map(|(&w, x)| i32::from(w) * x)
            .sum::<i32>()
            + layer.bias[0];
        let output = f64::from(sum) * f64::from(layer.multipliers[0]) / 4_294_967_296.0;
        // Expected output, from the unquantised weights: (0.5 * 10 - 1.0 * -5 + 3) * 2 = 26.
        assert!((output - 26.0).abs() < 0.5, "{output}");
    }

    #[test]
    fn a_row_without_weights_and_one_without_gain_are_representable() {
        assert_eq!(
            quantise(&[0.0, 0.0], 1.0, 2.0).expect("a dead row").weights,
            [0, 0]
        );
        assert_eq!(
            quantise(&[0.5, 1.0], 1.0, 0.0)
                .expect("no gain")
                .multipliers,
            [0]
        );
        assert!(quantise(&[0.0, 0.0], 0.0, 0.0).is_ok());
    }

    #[test]
    fn a_factor_beyond_a_half_and_an_accumulator_beyond_32_bits_are_refused() {
        let refused = |weights: &[f64], bias, gain| {
            quantise(weights, bias, gain)
                .expect_err("cannot be represented")
                .to_string()
        };
        assert!(refused(&[1.0, 1.0], 0.0, 1e6).contains("factor"));
        assert!(refused(&vec![1.0; 200_000], 0.0, 1.0).contains("accumulator"));
    }
}
