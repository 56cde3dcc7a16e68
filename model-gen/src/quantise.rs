//! From the float encoder to integers.
//!
//! Every layer's value is `integer * scale`. Weights have one scale per output channel, activations
//! one per tensor, chosen from the calibrated ranges. Batch norm stands behind the ReLU, so it does
//! not fold into its own convolution; with `g = weight / sqrt(variance + eps)` and
//! `b = bias - g * mean` the next layer sees `g * relu + b`, and without padding this is exact:
//! |g| goes into the requantisation, the sign of g into the next layer's weights, b times those
//! weights into its bias. In front of the max-pool a negative g turns the maximum into a minimum:
//! that channel's weights and bias are negated and its multiplier is negative.
//!
//! With padding the second convolution reads zeros behind the first batch norm. Its bias counts b
//! times all its weights, so a cell beyond the edge holds the integer that takes b back: the norm
//! turns `sign(g) * x` into 0 where `x = -sign(g) * b / scale`.

use artifact::{Artifact, CodeFormat, ELECTRODES, Geometry, HEAD_ROOM, NORM_EPSILON, ScalpGrid};

use crate::{
    ModelGenError,
    integer_model::{
        CODE, CONV1, CONV2, IntegerConv, IntegerLinear, IntegerModel, STEPS, largest_hidden,
    },
    rounding::{saturating_i8, to_i32},
    rows::{FloatLayer, IntegerLayer, LayerInput},
};

/// As [`HEAD_ROOM`], for codes, one bit: a blink or a jaw clench that is rarer than the calibration set is
/// long moves few dimensions far, and a clipped code costs more than all rounding.
const CODE_HEAD_ROOM: f64 = 2.0;

/// The same for codes of 16 bits and those with an exponent, four bits: what is left of 16 is still
/// finer than what the int8 input brings, and an exponent takes back what a window does not need.
const WIDE_CODE_HEAD_ROOM: f64 = 16.0;

/// Largest magnitude of a cell beyond the edges: kernels that read unsigned numbers lift a channel by
/// as much, activations up to 255 included, and keep it within 16 bits.
const LARGEST_PADDING: u16 = 32_767 - 255;

/// Features of the linear shortcut.
const LINEAR: usize = STEPS * ELECTRODES;

/// Quantises the encoder of an artifact.
///
/// # Errors
/// When a tensor is missing, a calibrated range is not positive, a factor leaves Q0.32, a padding
/// leaves 16 bits or an accumulator could leave 32 bits.
pub fn quantise(artifact: &Artifact) -> Result<IntegerModel, ModelGenError> {
    let mode = artifact.description.mode;
    let codes = CodeScales::of(artifact)?;
    let code_gain = codes.scale.map(|scale| 1.0 / scale);
    range(artifact, "input.max_abs")?;
    let input_scale_uv = artifact.input_scale_uv()?;
    let input = LayerInput {
        scale: input_scale_uv / artifact.description.input.sd_uv,
        largest: 128.0,
    };

    let convolutions = if mode.has_convolutions() {
        Convolutions::of(artifact, input, &code_gain)?
    } else {
        Convolutions::default()
    };
    let shortcut = if mode.has_shortcut() {
        let layer = Layer {
            weights: tensor(artifact, "encoder.shortcut.weight", &[CODE, LINEAR])?,
            bias: vec![0.0; CODE],
        };
        layer.quantise("shortcut", &code_gain, input)?
    } else {
        IntegerLayer::default()
    };

    let grid = ScalpGrid::new(&artifact.description);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the scalp grid has 90 cells"
    )]
    let cells = grid.cell_of_electrode().map(|cell| cell as u8);
    let Convolutions {
        hidden_padding,
        conv1,
        conv2,
        fc,
    } = convolutions;
    let mut fc_bias = [0; CODE];
    for (to, bias) in fc_bias.iter_mut().zip(&fc.bias) {
        *to = *bias;
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "scales are published as f32"
    )]
    Ok(IntegerModel {
        mode,
        geometry: Geometry::of(&artifact.description),
        input_scale_uv: input_scale_uv as f32,
        code_format: artifact.description.code.format,
        code_scale: codes.scale.map(|scale| scale as f32),
        code_zero_point: codes.zero_point,
        cells,
        conv1: convolution(conv1),
        hidden_padding,
        conv2: convolution(conv2),
        fc: IntegerLinear {
            weights: fc.weights,
            multipliers: fc.multipliers,
        },
        fc_bias,
        shortcut: IntegerLinear {
            weights: shortcut.weights,
            multipliers: shortcut.multipliers,
        },
    })
}

/// The convolutions and the fully connected layer behind them.
#[derive(Default)]
struct Convolutions {
    hidden_padding: [i16; CONV1],
    conv1: IntegerLayer,
    conv2: IntegerLayer,
    fc: IntegerLayer,
}

impl Convolutions {
    fn of(
        artifact: &Artifact,
        input: LayerInput,
        code_gain: &[f64],
    ) -> Result<Self, ModelGenError> {
        let geometry = Geometry::of(&artifact.description);
        let norm1 = Norm::read(artifact, "encoder.norm1", CONV1)?;
        let norm2 = Norm::read(artifact, "encoder.norm2", CONV2)?;
        let hidden_scale = range(artifact, "activation1.max")? / 255.0;
        let pooled_scale = range(artifact, "activation2.max")? / 255.0;
        let hidden_padding = if geometry.padding.pads_space() {
            norm1.padding(hidden_scale)?
        } else {
            [0; CONV1]
        };
        let hidden = LayerInput {
            scale: hidden_scale,
            largest: largest_hidden(&hidden_padding).into(),
        };
        let pooled = LayerInput {
            scale: pooled_scale,
            largest: 255.0,
        };

        let conv1 = Layer::read(artifact, "encoder.conv1", &[CONV1, 1, 3, 3, 3])?;
        // The sign of a factor goes into conv2's weights.
        let gain1: Vec<f64> = norm1
            .factor
            .iter()
            .map(|g| g.abs() / hidden.scale)
            .collect();
        let conv1 = conv1.quantise("conv1", &gain1, input)?;

        let mut conv2 = Layer::read(artifact, "encoder.conv2", &[CONV2, CONV1, 3, 3, 3])?;
        conv2.absorb(&norm1, 27);
        conv2.negate_where_negative(&norm2);
        // A negated channel keeps its negative factor, so that the product is positive again.
        let gain2: Vec<f64> = norm2.factor.iter().map(|g| g / pooled.scale).collect();
        let conv2 = conv2.quantise("conv2", &gain2, hidden)?;

        let mut fc = Layer::read(artifact, "encoder.fc", &[CODE, geometry.flat()])?;
        fc.absorb(&norm2, geometry.pooled.iter().product());
        Ok(Self {
            hidden_padding,
            conv1,
            conv2,
            fc: fc.quantise("fc", code_gain, pooled)?,
        })
    }
}

fn convolution(layer: IntegerLayer) -> IntegerConv {
    let IntegerLayer {
        weights,
        bias,
        multipliers,
    } = layer;
    IntegerConv {
        weights,
        bias,
        multipliers,
    }
}

/// A tensor as f64.
fn tensor(artifact: &Artifact, name: &str, shape: &[usize]) -> Result<Vec<f64>, ModelGenError> {
    let values = artifact.weights.tensor(name, shape)?;
    Ok(values.iter().map(|&v| f64::from(v)).collect())
}

/// A calibrated largest magnitude, with head room.
fn range(artifact: &Artifact, what: &'static str) -> Result<f64, ModelGenError> {
    let value = f64::from(artifact.calibration.tensor(what, &[1])?[0]);
    if value.is_finite() && value > 0.0 {
        Ok(value * HEAD_ROOM)
    } else {
        Err(ModelGenError::Calibration { what, value })
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
            .map(|(w, v)| w / (v + f64::from(NORM_EPSILON)).sqrt())
            .collect();
        let offset = bias
            .iter()
            .zip(&factor)
            .zip(&mean)
            .map(|((b, g), m)| b - g * m)
            .collect();
        Ok(Self { factor, offset })
    }

    /// What each channel holds, in steps of `scale` and before its sign, where the norm gives 0.
    fn padding(&self, scale: f64) -> Result<[i16; CONV1], ModelGenError> {
        let mut padding = [0; CONV1];
        let norm = self.factor.iter().zip(&self.offset);
        for ((channel, to), (factor, offset)) in padding.iter_mut().enumerate().zip(norm) {
            let sign = if *factor < 0.0 { -1.0 } else { 1.0 };
            let value = -sign * offset / scale;
            *to = to_i32(value)
                .and_then(|value| i16::try_from(value).ok())
                .filter(|value| value.unsigned_abs() <= LARGEST_PADDING)
                .ok_or(ModelGenError::HiddenPadding { channel, value })?;
        }
        Ok(padding)
    }
}

/// Weights `[output][input]...` and biases of a layer.
struct Layer {
    weights: Vec<f64>,
    bias: Vec<f64>,
}

impl Layer {
    fn read(artifact: &Artifact, name: &str, shape: &[usize]) -> Result<Self, ModelGenError> {
        Ok(Self {
            weights: tensor(artifact, &format!("{name}.weight"), shape)?,
            bias: tensor(artifact, &format!("{name}.bias"), &shape[..1])?,
        })
    }

    /// Moves sign and offset of the norm in front of this layer into it; each of the norm's
    /// channels has `taps` weights in a row.
    fn absorb(&mut self, norm: &Norm, taps: usize) {
        let channels = norm.factor.len();
        let rows = self.weights.chunks_exact_mut(channels * taps);
        for (weights, bias) in rows.zip(&mut self.bias) {
            for (channel, weights) in weights.chunks_exact_mut(taps).enumerate() {
                *bias += weights.iter().sum::<f64>() * norm.offset[channel];
                if norm.factor[channel] < 0.0 {
                    negate(weights);
                }
            }
        }
    }

    /// Negates the outputs whose norm, behind the max-pool, has a negative factor.
    fn negate_where_negative(&mut self, norm: &Norm) {
        let inputs = self.weights.len() / self.bias.len();
        let rows = self.weights.chunks_exact_mut(inputs);
        for ((weights, bias), factor) in rows.zip(&mut self.bias).zip(&norm.factor) {
            if *factor < 0.0 {
                negate(weights);
                *bias = -*bias;
            }
        }
    }

    fn quantise(
        &self,
        name: &'static str,
        gain: &[f64],
        input: LayerInput,
    ) -> Result<IntegerLayer, ModelGenError> {
        FloatLayer {
            name,
            weights: &self.weights,
            bias: &self.bias,
            gain,
        }
        .quantise(input)
    }
}

fn negate(weights: &mut [f64]) {
    for weight in weights {
        *weight = -*weight;
    }
}

/// Scale and zero point of each code dimension, from its calibrated minimum and maximum. A zero point
/// is worth a bit to 8 bits; the 16 of the other formats need none, and an exponent must not move it.
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
            // A range that holds 0 keeps the zero point within int8.
            let low = f64::from(smallest[j]).min(0.0);
            let high = f64::from(largest[j]).max(0.0);
            if high <= low {
                continue;
            }
            match artifact.description.code.format {
                CodeFormat::Int8 => {
                    codes.scale[j] = (high - low) / 2.0 * CODE_HEAD_ROOM / 127.0;
                    codes.zero_point[j] = saturating_i8(-(low + high) / 2.0 / codes.scale[j]);
                }
                CodeFormat::Int8Exponent | CodeFormat::Int16 => {
                    codes.scale[j] = high.max(-low) * WIDE_CODE_HEAD_ROOM / 32_767.0;
                }
            }
        }
        Ok(codes)
    }
}
