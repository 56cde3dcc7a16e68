//! Quantises a layer's weights and biases, proves that the results fit, and rounds f64 to integers.

use crate::{error::ModelGenError, integer_model::IntegerLayer};

/// Quantisation of a layer's input: `value = integer * scale`, with |integer| <= `largest`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerInput {
    pub(crate) scale: f64,
    pub(crate) largest: f64,
}

/// Weights `[output][input]...` and biases of a layer, before quantisation.
pub(crate) struct Layer {
    pub(crate) weights: Vec<f64>,
    pub(crate) bias: Vec<f64>,
}

impl Layer {
    /// Quantises the weights with one scale for each output, and proves that the accumulator and
    /// the requantisation factor of every output fit 32 bits.
    ///
    /// `gain` is, for each output, the number of quantised output levels per unit of the float
    /// layer's output; it can be negative.
    pub(crate) fn quantise(
        &self,
        name: &'static str,
        gain: &[f64],
        input: LayerInput,
    ) -> Result<IntegerLayer, ModelGenError> {
        let mut integers = IntegerLayer::default();
        let inputs = self.weights.len() / self.bias.len();
        for (output, row) in self.weights.chunks_exact(inputs).enumerate() {
            let (bias, gain) = (self.bias[output], gain[output]);
            let (weights, scale) = weights_i8(row, finest_scale(bias, gain, input));
            let unit = input.scale * scale;
            let sum: f64 = weights.iter().map(|&w| f64::from(w).abs()).sum();
            let worst = sum * input.largest + (bias / unit).abs();
            let overflow = ModelGenError::Accumulator(name, output, worst);
            let bias = to_i32(bias / unit).filter(|_| worst < f64::from(i32::MAX));
            integers.bias.push(bias.ok_or(overflow)?);
            let factor = gain * unit;
            let multiplier = to_i32(factor * 4_294_967_296.0);
            let too_large = ModelGenError::Multiplier(name, output, factor);
            integers.multipliers.push(multiplier.ok_or(too_large)?);
            integers.weights.extend(weights);
        }
        Ok(integers)
    }
}

/// Returns the smallest permitted scale of an output's weights. With this scale, the Q0.32
/// requantisation factor is at least 2^8 (unless the gain is 0) and the bias at most 2^24 in
/// magnitude, so even an output with negligible weights can be represented.
fn finest_scale(bias: f64, gain: f64, input: LayerInput) -> f64 {
    const TWO_TO_24: f64 = 16_777_216.0;
    let output_level = if gain == 0.0 { 0.0 } else { 1.0 / gain.abs() };
    (bias.abs().max(output_level) / (input.scale * TWO_TO_24)).max(f64::MIN_POSITIVE)
}

/// Quantises weights with one scale, which is at least `smallest_scale`. Returns the integers, with
/// |integer| <= 127, and the scale: `weight = integer * scale`.
fn weights_i8(weights: &[f64], smallest_scale: f64) -> (Vec<i8>, f64) {
    let largest = weights.iter().fold(0.0, |m: f64, w| m.max(w.abs()));
    let scale = (largest / 127.0).max(smallest_scale);
    (weights.iter().map(|w| saturating_i8(w / scale)).collect(), scale)
}

/// Rounds half away from zero and saturates to -128..=127.
#[expect(clippy::cast_possible_truncation, reason = "clamped to -128..=127")]
pub(crate) fn saturating_i8(value: f64) -> i8 {
    value.round().clamp(-128.0, 127.0) as i8
}

/// Rounds half away from zero; returns `None` if the result does not fit 32 bits.
#[expect(clippy::cast_possible_truncation, reason = "checked against the range of i32")]
pub(crate) fn to_i32(value: f64) -> Option<i32> {
    let rounded = value.round();
    (rounded.abs() < f64::from(i32::MAX)).then_some(rounded as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUT: LayerInput = LayerInput { scale: 0.1, largest: 128.0 };

    fn quantise(weights: &[f64], bias: f64, gain: f64) -> Result<IntegerLayer, ModelGenError> {
        let layer = Layer { weights: weights.to_vec(), bias: vec![bias] };
        layer.quantise("test", &[gain], INPUT)
    }

    #[test]
    fn a_quantised_row_is_within_half_a_level_of_the_float_row() {
        let layer = quantise(&[0.5, -1.0], 3.0, 2.0).expect("an ordinary row");
        let x = [100, -50];
        let sum: i32 = layer.weights.iter().zip(x).map(|(&w, x)| i32::from(w) * x).sum::<i32>()
            + layer.bias[0];
        let output = f64::from(sum) * f64::from(layer.multipliers[0]) / 4_294_967_296.0;
        // The unquantised weights give an output of (0.5 * 10 - 1.0 * -5 + 3) * 2 = 26.
        assert!((output - 26.0).abs() < 0.5, "{output}");
    }

    #[test]
    fn a_row_without_weights_and_one_without_gain_are_representable() {
        assert_eq!(quantise(&[0.0, 0.0], 1.0, 2.0).expect("a dead row").weights, [0, 0]);
        assert_eq!(quantise(&[0.5, 1.0], 1.0, 0.0).expect("no gain").multipliers, [0]);
        assert!(quantise(&[0.0, 0.0], 0.0, 0.0).is_ok());
    }

    #[test]
    fn a_factor_beyond_a_half_and_an_accumulator_beyond_32_bits_are_refused() {
        let refused = |weights: &[f64], bias, gain| {
            quantise(weights, bias, gain).expect_err("cannot be represented").to_string()
        };
        assert!(refused(&[1.0, 1.0], 0.0, 1e6).contains("factor"));
        assert!(refused(&vec![1.0; 200_000], 0.0, 1.0).contains("accumulator"));
    }

    #[test]
    fn a_number_beyond_32_bits_is_refused() {
        assert_eq!(to_i32(1e10), None);
        assert_eq!(to_i32(f64::NAN), None);
        assert_eq!(to_i32(-2.5), Some(-3));
    }
}
