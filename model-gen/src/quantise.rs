//! From the float encoder to integers.
//!
//! Every layer's value is `integer * scale`. Weights have one scale per output channel, activations
//! one per tensor, chosen from the calibrated ranges. Batch norm stands behind the ReLU, so it does
//! not fold into its own convolution; with `g = weight / sqrt(variance + eps)` and
//! `b = bias - g * mean` the next layer sees `g * relu + b`, and without padding this is exact:
//! |g| goes into the requantisation, the sign of g into the next layer's weights, b times those
//! weights into its bias. In front of the max-pool a negative g turns the maximum into a minimum:
//! that channel's weights and bias are negated and its multiplier is negative.

use artifact::{Artifact, ELECTRODES, ScalpGrid};

use crate::{
    ModelGenError,
    integer_model::{
        CODE, CONV1, CONV2, FLAT, IntegerConv, IntegerLinear, IntegerModel, POOLED, STEPS,
    },
    rounding::{saturating_i8, to_i32, weights_i8},
};

/// Batch norm's epsilon, PyTorch's default.
const EPSILON: f64 = 1e-5;

/// The quantised input and activations reach this much further than the calibration set did:
/// clipping costs far more than resolution.
const HEAD_ROOM: f64 = 1.25;

/// Features of the linear shortcut.
const LINEAR: usize = STEPS * ELECTRODES;

/// Quantises the encoder of an artifact.
///
/// # Errors
/// When a tensor is missing, a calibrated range is not positive, a factor leaves Q0.32 or an
/// accumulator could leave 32 bits.
pub fn quantise(artifact: &Artifact) -> Result<IntegerModel, ModelGenError> {
    let ranges = Ranges::of(artifact)?;
    let input_scale_uv = ranges.input_uv / 127.0;
    let input_scale = input_scale_uv / artifact.description.input.sd_uv;
    let hidden_scale = ranges.hidden / 255.0;
    let pooled_scale = ranges.pooled / 255.0;

    let norm1 = Norm::read(artifact, "encoder.norm1", CONV1)?;
    let norm2 = Norm::read(artifact, "encoder.norm2", CONV2)?;

    let conv1 = FloatConv::read(artifact, "encoder.conv1", CONV1, 1)?;
    let conv1 = conv1.quantise("conv1", input_scale, hidden_scale, &norm1, 127.0)?;

    let mut conv2 = FloatConv::read(artifact, "encoder.conv2", CONV2, CONV1)?;
    absorb(&norm1, &mut conv2.weights, &mut conv2.bias, 27);
    conv2.negate_where(&norm2);
    let conv2 = conv2.quantise("conv2", hidden_scale, pooled_scale, &norm2, 255.0)?;

    let mut fc_weights = tensor(artifact, "encoder.fc.weight", &[CODE, FLAT])?;
    let mut fc_bias = tensor(artifact, "encoder.fc.bias", &[CODE])?;
    absorb(
        &norm2,
        &mut fc_weights,
        &mut fc_bias,
        POOLED.iter().product(),
    );
    let shortcut = tensor(artifact, "encoder.shortcut.weight", &[CODE, LINEAR])?;

    let codes = CodeScales::of(artifact)?;
    let fc = linear("fc", &fc_weights, &fc_bias, pooled_scale, &codes.scale)?;
    let mut fc_bias_steps = [0_i32; CODE];
    for j in 0..CODE {
        let step = pooled_scale * fc.scales[j];
        fc_bias_steps[j] = to_i32(fc_bias[j] / step).ok_or(ModelGenError::Accumulator {
            layer: "fc",
            output: j,
            worst: (fc_bias[j] / step).abs(),
        })?;
        prove_accumulator(
            "fc",
            j,
            row(&fc.integers.weights, j),
            fc_bias_steps[j],
            255.0,
        )?;
    }
    let shortcut = linear(
        "shortcut",
        &shortcut,
        &[0.0; CODE],
        input_scale,
        &codes.scale,
    )?;

    let grid = ScalpGrid::new(&artifact.description);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the scalp grid has 90 cells"
    )]
    let cells = grid.cell_of_electrode().map(|cell| cell as u8);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "scales are published as f32"
    )]
    Ok(IntegerModel {
        input_scale_uv: input_scale_uv as f32,
        code_scale: codes.scale.map(|scale| scale as f32),
        code_zero_point: codes.zero_point,
        cells,
        conv1,
        conv2,
        fc: fc.integers,
        fc_bias: fc_bias_steps,
        shortcut: shortcut.integers,
    })
}

/// A tensor as f64, or zeros where this artifact's mode has no such layer.
fn tensor(artifact: &Artifact, name: &str, shape: &[usize]) -> Result<Vec<f64>, ModelGenError> {
    let mode = artifact.description.mode;
    let exists = if name.contains("shortcut") {
        mode.has_shortcut()
    } else {
        mode.has_convolutions()
    };
    if !exists {
        return Ok(vec![0.0; shape.iter().product()]);
    }
    Ok(artifact
        .weights
        .tensor(name, shape)?
        .iter()
        .map(|&v| f64::from(v))
        .collect())
}

/// Largest magnitudes, with head room.
struct Ranges {
    input_uv: f64,
    hidden: f64,
    pooled: f64,
}

impl Ranges {
    fn of(artifact: &Artifact) -> Result<Self, ModelGenError> {
        let read = |what: &'static str| -> Result<f64, ModelGenError> {
            let value = f64::from(artifact.calibration.tensor(what, &[1])?[0]);
            if value.is_finite() && value > 0.0 {
                Ok(value * HEAD_ROOM)
            } else {
                Err(ModelGenError::Calibration { what, value })
            }
        };
        let activation = |what| {
            if artifact.description.mode.has_convolutions() {
                read(what)
            } else {
                Ok(1.0)
            }
        };
        Ok(Self {
            input_uv: read("input.max_abs")?,
            hidden: activation("activation1.max")?,
            pooled: activation("activation2.max")?,
        })
    }
}

/// Batch norm as `factor * x + offset`.
struct Norm {
    factor: Vec<f64>,
    offset: Vec<f64>,
}

impl Norm {
    fn read(artifact: &Artifact, name: &str, channels: usize) -> Result<Self, ModelGenError> {
        let read = |part: &str| tensor(artifact, &format!("{name}.{part}"), &[channels]);
        let (weight, bias) = (read("weight")?, read("bias")?);
        let (mean, variance) = (read("running_mean")?, read("running_var")?);
        let factor: Vec<f64> = weight
            .iter()
            .zip(&variance)
            .map(|(w, v)| w / (v + EPSILON).sqrt())
            .collect();
        let offset = bias
            .iter()
            .zip(&factor)
            .zip(&mean)
            .map(|((b, g), m)| b - g * m)
            .collect();
        Ok(Self { factor, offset })
    }
}

/// Moves a norm's sign and offset into the layer that reads it: `weights` are
/// `[output][channel][taps]`.
fn absorb(norm: &Norm, weights: &mut [f64], bias: &mut [f64], taps: usize) {
    let channels = norm.factor.len();
    for (weights, bias) in weights.chunks_exact_mut(channels * taps).zip(bias) {
        for (channel, weights) in weights.chunks_exact_mut(taps).enumerate() {
            *bias += weights.iter().sum::<f64>() * norm.offset[channel];
            if norm.factor[channel] < 0.0 {
                negate(weights);
            }
        }
    }
}

fn negate(weights: &mut [f64]) {
    for weight in weights {
        *weight = -*weight;
    }
}

/// Weights `[output][input][27]` and biases of a convolution.
struct FloatConv {
    weights: Vec<f64>,
    bias: Vec<f64>,
}

impl FloatConv {
    fn read(
        artifact: &Artifact,
        name: &str,
        outputs: usize,
        inputs: usize,
    ) -> Result<Self, ModelGenError> {
        Ok(Self {
            weights: tensor(
                artifact,
                &format!("{name}.weight"),
                &[outputs, inputs, 3, 3, 3],
            )?,
            bias: tensor(artifact, &format!("{name}.bias"), &[outputs])?,
        })
    }

    fn negate_where(&mut self, norm: &Norm) {
        let per_output = self.weights.len() / self.bias.len();
        for (output, factor) in norm.factor.iter().enumerate() {
            if *factor < 0.0 {
                self.bias[output] = -self.bias[output];
                negate(&mut self.weights[output * per_output..][..per_output]);
            }
        }
    }

    /// `largest_input` is the largest magnitude of a quantised input, for the range proof.
    fn quantise(
        &self,
        layer: &'static str,
        input_scale: f64,
        output_scale: f64,
        norm: &Norm,
        largest_input: f64,
    ) -> Result<IntegerConv, ModelGenError> {
        let outputs = self.bias.len();
        let mut integers = IntegerConv {
            weights: Vec::with_capacity(self.weights.len()),
            bias: Vec::with_capacity(outputs),
            multipliers: Vec::with_capacity(outputs),
        };
        for (output, floats) in self
            .weights
            .chunks_exact(self.weights.len() / outputs)
            .enumerate()
        {
            let smallest = smallest_weight_scale(self.bias[output], input_scale, output_scale);
            let (weights, weight_scale) = weights_i8(floats, smallest);
            let step = input_scale * weight_scale;
            let bias = to_i32(self.bias[output] / step).ok_or(ModelGenError::Accumulator {
                layer,
                output,
                worst: (self.bias[output] / step).abs(),
            })?;
            prove_accumulator(layer, output, &weights, bias, largest_input)?;
            // conv2's negated channels keep their negative factor; conv1's sign went into conv2.
            let factor = if layer == "conv2" {
                norm.factor[output]
            } else {
                norm.factor[output].abs()
            };
            let what = || format!("{layer} (output {output})");
            integers
                .multipliers
                .push(multiplier(what, factor * step / output_scale)?);
            integers.weights.extend(weights);
            integers.bias.push(bias);
        }
        Ok(integers)
    }
}

struct QuantisedLinear {
    integers: IntegerLinear,
    scales: Vec<f64>,
}

fn linear(
    layer: &'static str,
    weights: &[f64],
    bias: &[f64],
    input_scale: f64,
    code_scale: &[f64; CODE],
) -> Result<QuantisedLinear, ModelGenError> {
    let mut integers = IntegerLinear {
        weights: Vec::new(),
        multipliers: Vec::new(),
    };
    let mut scales = Vec::with_capacity(CODE);
    for (output, floats) in weights.chunks_exact(weights.len() / CODE).enumerate() {
        let smallest = smallest_weight_scale(bias[output], input_scale, code_scale[output]);
        let (weights, scale) = weights_i8(floats, smallest);
        prove_accumulator(layer, output, &weights, 0, 255.0)?;
        let what = || format!("{layer} (output {output})");
        integers
            .multipliers
            .push(multiplier(what, input_scale * scale / code_scale[output])?);
        integers.weights.extend(weights);
        scales.push(scale);
    }
    Ok(QuantisedLinear { integers, scales })
}

fn row(weights: &[i8], output: usize) -> &[i8] {
    let length = weights.len() / CODE;
    &weights[output * length..][..length]
}

/// Scale and zero point of each code dimension, from its calibrated minimum and maximum.
struct CodeScales {
    scale: [f64; CODE],
    zero_point: [i8; CODE],
}

impl CodeScales {
    fn of(artifact: &Artifact) -> Result<Self, ModelGenError> {
        let smallest = artifact.calibration.tensor("code.min", &[CODE])?;
        let largest = artifact.calibration.tensor("code.max", &[CODE])?;
        let mut codes = Self {
            scale: [1.0; CODE],
            zero_point: [0; CODE],
        };
        for j in 0..CODE {
            let (low, high) = (f64::from(smallest[j]), f64::from(largest[j]));
            let half = (high - low) / 2.0 * HEAD_ROOM;
            if half > 0.0 {
                codes.scale[j] = half / 127.0;
                codes.zero_point[j] = saturating_i8(-(low + high) / 2.0 / codes.scale[j]);
            }
        }
        Ok(codes)
    }
}

/// The finest weight scale that makes sense: the requantisation factor keeps at least 8 bits, and
/// the bias at most 24, so that a dead output (no weights to speak of) stays representable.
fn smallest_weight_scale(bias: f64, input_scale: f64, output_scale: f64) -> f64 {
    const TWO_TO_24: f64 = 16_777_216.0;
    (bias.abs().max(output_scale)) / (input_scale * TWO_TO_24)
}

/// A factor as Q0.32.
fn multiplier(what: impl Fn() -> String, factor: f64) -> Result<i32, ModelGenError> {
    to_i32(factor * 4_294_967_296.0).ok_or_else(|| ModelGenError::Multiplier {
        what: what(),
        factor,
    })
}

/// No input can take this output's accumulator out of 32 bits.
fn prove_accumulator(
    layer: &'static str,
    output: usize,
    weights: &[i8],
    bias: i32,
    largest_input: f64,
) -> Result<(), ModelGenError> {
    let weights: f64 = weights.iter().map(|&w| f64::from(w).abs()).sum();
    let worst = weights * largest_input.max(128.0) + f64::from(bias).abs();
    if worst < f64::from(i32::MAX) {
        Ok(())
    } else {
        Err(ModelGenError::Accumulator {
            layer,
            output,
            worst,
        })
    }
}
