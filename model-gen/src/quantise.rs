//! Quantises the float encoder to integers.
//!
//! Every value is `integer * scale`. Weights have one scale for each output channel. Activations
//! have one scale for each tensor, derived from the calibrated range.
//!
//! Batch norm follows the ReLU, so it cannot be folded into the convolution before it. With
//! `g = weight / sqrt(variance + eps)` and `b = bias - g * mean`, the next layer reads
//! `g * relu + b`. So |g| goes into the requantisation factor of the convolution, the sign of g
//! into the next layer's weights, and b times these weights into the next layer's bias. Without
//! padding this is exact. Before the max-pool, a negative g would turn the maximum into a minimum,
//! so the weights and the bias of such a channel are negated, and its requantisation factor is
//! negative.
//!
//! With padding, padded cells must be 0 after the first batch norm. The second convolution,
//! however, reads its inputs before the norm, and its bias contains b times all its weights. So a
//! padded cell holds the integer x that the norm turns into 0: `x = -sign(g) * b / scale`.

use artifact::{
    Artifact, CONV1_CHANNELS, CONV2_CHANNELS, CodeFormat, Geometry, HEAD_ROOM, KERNEL,
    NORM_EPSILON, ScalpGrid,
};

use crate::{
    error::ModelGenError,
    integer_model::{IntegerLayer, IntegerModel, largest_hidden},
    layer::{Layer, LayerInput, saturating_i8, to_i32},
};

/// Range of an 8-bit code relative to the range in calibration: a factor of two, which costs one
/// bit. A blink or a jaw clench that is not in the calibration set drives few dimensions far beyond
/// their range, and clipping a code costs more than all rounding.
const CODE_HEAD_ROOM: f64 = 2.0;

/// Range of a 16-bit code, or of a code with an exponent, relative to the range in calibration: a
/// factor of 16, or four bits. The other 12 bits still resolve more finely than the int8 input.
/// With an exponent, windows that do not need the whole range have a finer resolution.
const WIDE_CODE_HEAD_ROOM: f64 = 16.0;

/// Largest magnitude of a padding value. The kernels add the magnitude of a negative padding value
/// to all inputs of its channel, which are at most 255, and the sum must fit 16 bits.
const LARGEST_PADDING: u16 = 32_767 - 255;

/// Quantises the encoder of an artifact. For a model without a network, the result holds only the
/// input scale and the electrodes' cells.
///
/// # Errors
/// If a tensor is missing, a calibrated range is not positive, a factor does not fit Q0.32, a
/// padding does not fit 16 bits, or an accumulator could overflow 32 bits.
pub fn quantise(artifact: &Artifact) -> Result<IntegerModel, ModelGenError> {
    let mode = artifact.description.mode;
    let dimensions = artifact.description.dimensions();
    let numbers = dimensions.numbers;
    let codes = if mode.has_network() {
        CodeScales::from_calibration(artifact)?
    } else {
        CodeScales::default()
    };
    let code_gain: Vec<f64> = codes.scale.iter().map(|scale| 1.0 / scale).collect();
    range(artifact, "input.max_abs")?;
    let input_scale_uv = artifact.input_scale_uv()?;
    let input =
        LayerInput { scale: input_scale_uv / artifact.description.input.sd_uv, largest: 128.0 };

    let convolutions = if mode.has_convolutions() {
        Convolutions::quantise(artifact, input, &code_gain)?
    } else {
        Convolutions::default()
    };
    let shortcut = if mode.has_shortcut() {
        let layer = Layer {
            weights: tensor(
                artifact,
                "encoder.shortcut.weight",
                &[numbers, dimensions.window_electrodes()],
            )?,
            bias: vec![0.0; numbers],
        };
        layer.quantise("shortcut", &code_gain, input)?
    } else {
        IntegerLayer::default()
    };

    let grid = ScalpGrid::new(&artifact.description);
    #[expect(clippy::cast_possible_truncation, reason = "a scalp grid has at most 144 cells")]
    let cells = grid.cell_of_electrode().iter().map(|&cell| cell as u8);
    let Convolutions { hidden_padding, conv1, conv2, fc } = convolutions;
    #[expect(clippy::cast_possible_truncation, reason = "scales are published as f32")]
    Ok(IntegerModel {
        mode,
        geometry: Geometry::new(&artifact.description),
        input_scale_uv: input_scale_uv as f32,
        code_format: artifact.description.code.format,
        code_scale: codes.scale.iter().map(|&scale| scale as f32).collect(),
        code_zero_point: codes.zero_point,
        cells: cells.collect(),
        conv1,
        hidden_padding,
        conv2,
        fc,
        shortcut,
    })
}

/// The quantised convolutions, and the fully connected layer that reads their output.
#[derive(Default)]
struct Convolutions {
    hidden_padding: [i16; CONV1_CHANNELS],
    conv1: IntegerLayer,
    conv2: IntegerLayer,
    fc: IntegerLayer,
}

impl Convolutions {
    fn quantise(
        artifact: &Artifact,
        input: LayerInput,
        code_gain: &[f64],
    ) -> Result<Self, ModelGenError> {
        let geometry = Geometry::new(&artifact.description);
        let norm1 = Norm::read(artifact, "encoder.norm1", CONV1_CHANNELS)?;
        let norm2 = Norm::read(artifact, "encoder.norm2", CONV2_CHANNELS)?;
        let hidden_scale = range(artifact, "activation1.max")? / 255.0;
        let pooled_scale = range(artifact, "activation2.max")? / 255.0;
        let hidden_padding = if geometry.padding.pads_space() {
            norm1.padding(hidden_scale)?
        } else {
            [0; CONV1_CHANNELS]
        };
        let hidden =
            LayerInput { scale: hidden_scale, largest: largest_hidden(&hidden_padding).into() };
        let pooled = LayerInput { scale: pooled_scale, largest: 255.0 };

        let conv1 =
            Layer::read(artifact, "encoder.conv1", &[CONV1_CHANNELS, 1, KERNEL, KERNEL, KERNEL])?;
        // Use the magnitudes of norm1's factors: `absorb` folds the signs into conv2's weights.
        let gain1: Vec<f64> = norm1.factor.iter().map(|g| g.abs() / hidden.scale).collect();
        let conv1 = conv1.quantise("conv1", &gain1, input)?;

        let mut conv2 = Layer::read(
            artifact,
            "encoder.conv2",
            &[CONV2_CHANNELS, CONV1_CHANNELS, KERNEL, KERNEL, KERNEL],
        )?;
        conv2.absorb(&norm1, KERNEL.pow(3));
        conv2.negate_outputs(&norm2);
        // Keep the signs of norm2's factors: `negate_outputs` has negated the weights of the
        // channels with negative factors, and the product of weight and factor must have the
        // original sign.
        let gain2: Vec<f64> = norm2.factor.iter().map(|g| g / pooled.scale).collect();
        let conv2 = conv2.quantise("conv2", &gain2, hidden)?;

        let mut fc =
            Layer::read(artifact, "encoder.fc", &[geometry.dimensions.numbers, geometry.flat()])?;
        fc.absorb(&norm2, geometry.pooled.iter().product());
        Ok(Self { hidden_padding, conv1, conv2, fc: fc.quantise("fc", code_gain, pooled)? })
    }
}

/// Returns the tensor `name` of the network's weights as f64.
fn tensor(artifact: &Artifact, name: &str, shape: &[usize]) -> Result<Vec<f64>, ModelGenError> {
    let values = artifact.weights.tensor(name, shape)?;
    Ok(values.iter().map(|&v| f64::from(v)).collect())
}

/// Returns the calibrated largest magnitude `what`, times [`HEAD_ROOM`].
fn range(artifact: &Artifact, what: &'static str) -> Result<f64, ModelGenError> {
    let value = f64::from(artifact.calibration.tensor(what, &[1])?[0]);
    if value.is_finite() && value > 0.0 {
        Ok(value * HEAD_ROOM)
    } else {
        Err(ModelGenError::Calibration(what, value))
    }
}

/// Batch norm at inference: `factor * x + offset` for each channel.
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
        let offset = bias.iter().zip(&factor).zip(&mean).map(|((b, g), m)| b - g * m).collect();
        Ok(Self { factor, offset })
    }

    /// Returns, for each channel, the integer that the norm turns into 0. The integer is |factor|
    /// times the norm's input, in units of `scale`.
    fn padding(&self, scale: f64) -> Result<[i16; CONV1_CHANNELS], ModelGenError> {
        let mut padding = [0; CONV1_CHANNELS];
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

impl Layer {
    fn read(artifact: &Artifact, name: &str, shape: &[usize]) -> Result<Self, ModelGenError> {
        Ok(Self {
            weights: tensor(artifact, &format!("{name}.weight"), shape)?,
            bias: tensor(artifact, &format!("{name}.bias"), &shape[..1])?,
        })
    }

    /// Folds the signs and offsets of the preceding norm into this layer, which has `taps`
    /// consecutive weights for each channel of the norm.
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

    /// Negates the outputs that the following norm multiplies by a negative factor, so that the
    /// max-pool between this layer and the norm still selects the norm's largest output.
    fn negate_outputs(&mut self, norm: &Norm) {
        let inputs = self.weights.len() / self.bias.len();
        let rows = self.weights.chunks_exact_mut(inputs);
        for ((weights, bias), factor) in rows.zip(&mut self.bias).zip(&norm.factor) {
            if *factor < 0.0 {
                negate(weights);
                *bias = -*bias;
            }
        }
    }
}

fn negate(weights: &mut [f64]) {
    for weight in weights {
        *weight = -*weight;
    }
}

/// Scale and zero point of each code dimension; empty without a network. Only the `int8` format has
/// a zero point, which gains up to one bit of resolution. `int16` has bits to spare, and in
/// `int8-exponent` the zero point would have to change with the exponent.
#[derive(Default)]
struct CodeScales {
    scale: Vec<f64>,
    zero_point: Vec<i8>,
}

impl CodeScales {
    /// Derives scales and zero points from each dimension's range in calibration.
    fn from_calibration(artifact: &Artifact) -> Result<Self, ModelGenError> {
        let numbers = artifact.description.code.numbers;
        let smallest = artifact.calibration.tensor("code.min", &[numbers])?;
        let largest = artifact.calibration.tensor("code.max", &[numbers])?;
        let mut codes = Self { scale: vec![1.0; numbers], zero_point: vec![0; numbers] };
        for j in 0..numbers {
            // Extend the range to contain 0, so that the zero point fits int8.
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
