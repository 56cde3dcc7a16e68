//! Reorders weights from PyTorch's layout into the packed layout that the kernels read.

use artifact::{CONV1_CHANNELS, CONV2_CHANNELS, Dimensions, KERNEL, SubstitutionTable};
use int8_nn::{Direct, InputConv, Linear, Pair, Winograd};

use crate::integer_model::{IntegerLayer, IntegerModel};

/// Number of weights for each pair of input and output channel: steps x rows x columns of a kernel.
const TAPS: usize = KERNEL.pow(3);
/// Number of channel pairs that the second convolution reads.
const HIDDEN_PAIRS: usize = CONV1_CHANNELS / 2;

/// Implementation of the second convolution that runs on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConvKernel {
    /// [`int8_nn::Winograd`], which needs the fewest instructions.
    Winograd,
    /// [`int8_nn::Direct`], which supports every pool and every input range.
    Direct,
}

impl ConvKernel {
    /// Selects the Winograd kernel if each of its tiles of 2x4 outputs holds two whole pools and
    /// its intermediate values fit 16 bits, otherwise the direct kernel.
    ///
    /// A model without convolutions gets the direct kernel, which is never run.
    pub fn select(model: &IntegerModel) -> Self {
        type Kernel = Winograd<'static, HIDDEN_PAIRS, 6>;
        if !model.mode.has_convolutions() {
            return Self::Direct;
        }
        let [_, rows, columns] = model.geometry.pool;
        let largest = usize::from(UnsignedInput::from_model(model).largest());
        let whole_tiles = model.geometry.pooled[2].is_multiple_of(2);
        if [rows, columns] == [2, 2] && whole_tiles && largest <= Kernel::LARGEST_INPUT {
            Self::Winograd
        } else {
            Self::Direct
        }
    }
}

/// Packs the weights of the first convolution for [`InputConv`].
pub fn input_convolution(conv: &IntegerLayer) -> Vec<Pair> {
    // The packed weights do not depend on the number of input columns, which is set to 0 here.
    type Conv = InputConv<'static, 0>;
    let outputs = conv.bias.len();
    let mut packed = vec![Pair::ZERO; Conv::weights_len(outputs)];
    Conv::pack_weights(outputs, &by_tap(conv), &mut packed);
    packed
}

/// Returns the second convolution's weights, transformed (Winograd kernel) or packed (direct
/// kernel).
pub fn convolution(model: &IntegerModel) -> Vec<Pair> {
    // The packed weights do not depend on the number of input columns, which is set to 6 here.
    type Transformed = Winograd<'static, HIDDEN_PAIRS, 6>;
    type Plain = Direct<'static, HIDDEN_PAIRS, 6>;
    let (outputs, weights) = (model.conv2.bias.len(), by_tap(&model.conv2));
    let kernel = ConvKernel::select(model);
    let length = match kernel {
        ConvKernel::Winograd => Transformed::weights_len(outputs),
        ConvKernel::Direct => Plain::weights_len(outputs),
    };
    let mut packed = vec![Pair::ZERO; length];
    match kernel {
        ConvKernel::Winograd => Transformed::transform_weights(outputs, &weights, &mut packed),
        ConvKernel::Direct => Plain::pack_weights(outputs, &weights, &mut packed),
    }
    packed
}

/// Reorders weights from PyTorch's `[out][in][tap]` to `[tap][in][out]`; a tap is one (time, row,
/// column) of the kernel.
fn by_tap(conv: &IntegerLayer) -> Vec<i8> {
    let outputs = conv.bias.len();
    let per_tap = conv.weights.len() / TAPS;
    (0..conv.weights.len())
        .map(|index| {
            let (tap, rest) = (index / per_tap, index % per_tap);
            let (input, output) = (rest / outputs, rest % outputs);
            conv.weights[(output * per_tap / outputs + input) * TAPS + tap]
        })
        .collect()
}

/// Packs the fully connected layer. Returns the matrices ([`fc_pieces`] many) of each pooled plane,
/// with inputs in the order `[position][channel]`; PyTorch's order is
/// `[out][channel][plane][position]`. Returns an empty list for a model without convolutions.
pub fn fully_connected(model: &IntegerModel) -> Vec<Vec<Vec<Pair>>> {
    if !model.mode.has_convolutions() {
        return Vec::new();
    }
    let [planes, rows, columns] = model.geometry.pooled;
    let positions = rows * columns;
    let flat = model.geometry.flat();
    let numbers = model.geometry.dimensions.numbers;
    let weights: Vec<i8> = (0..flat * numbers)
        .map(|index| {
            let (input, output) = (index / numbers, index % numbers);
            let (plane, rest) =
                (input / (positions * CONV2_CHANNELS), input % (positions * CONV2_CHANNELS));
            let (position, channel) = (rest / CONV2_CHANNELS, rest % CONV2_CHANNELS);
            model.fc.weights[output * flat + (channel * planes + plane) * positions + position]
        })
        .collect();
    let pieces = fc_pieces(model);
    let pairs = positions * CONV2_CHANNELS / 2 / pieces;
    let mut matrices = matrices(&weights, numbers, planes * pieces, pairs).into_iter();
    (0..planes).map(|_| matrices.by_ref().take(pieces).collect()).collect()
}

/// Returns the number of equal matrices, called pieces, into which the weights of the fully
/// connected layer for one pooled plane are split. It is the smallest number with which [`Linear`]
/// supports each piece and each piece has a multiple of eight pairs of inputs.
///
/// Returns 1 for a model without convolutions.
pub fn fc_pieces(model: &IntegerModel) -> usize {
    if !model.mode.has_convolutions() {
        return 1;
    }
    let [_, rows, columns] = model.geometry.pooled;
    let pairs = rows * columns * CONV2_CHANNELS / 2;
    let fewest = pairs.div_ceil(Linear::MAX_INPUTS);
    (fewest..=pairs).find(|pieces| pairs.is_multiple_of(8 * pieces)).unwrap_or(pairs)
}

/// Packs the linear shortcut and returns one matrix for each time step; PyTorch's order is
/// `[out][step * electrodes + electrode]`. Returns an empty list for a model without a shortcut.
pub fn shortcut(model: &IntegerModel) -> Vec<Vec<Pair>> {
    if !model.mode.has_shortcut() {
        return Vec::new();
    }
    let Dimensions { steps, electrodes, numbers, .. } = model.geometry.dimensions;
    let inputs = steps * electrodes;
    let weights: Vec<i8> = (0..inputs * numbers)
        .map(|index| model.shortcut.weights[index % numbers * inputs + index / numbers])
        .collect();
    matrices(&weights, numbers, steps, electrode_pairs(electrodes))
}

/// Returns the number of input pairs of one time step, rounded up to a multiple of eight; zeros
/// fill the rest.
pub fn electrode_pairs(electrodes: usize) -> usize {
    electrodes.div_ceil(2).next_multiple_of(8)
}

/// Packs a table of substitutions as a matrix from electrodes to predictions. Zeros pad the outputs
/// to a multiple of four.
pub fn substitution(table: &SubstitutionTable) -> Vec<Pair> {
    let electrodes = table.innovation.len();
    let outputs = electrodes.next_multiple_of(4);
    let mut weights = vec![0; electrodes * outputs];
    for (index, &weight) in table.weights.iter().enumerate() {
        weights[index % electrodes * outputs + index / electrodes] = weight;
    }
    matrices(&weights, outputs, 1, electrode_pairs(electrodes)).concat()
}

/// Splits weights `[input][output]` into equal parts by inputs, and packs each part for `pairs`
/// pairs of inputs.
fn matrices(weights: &[i8], outputs: usize, parts: usize, pairs: usize) -> Vec<Vec<Pair>> {
    weights
        .chunks_exact(weights.len() / parts)
        .map(|weights| {
            let mut packed = vec![Pair::ZERO; pairs * outputs / 2];
            Linear::pack_weights(pairs, outputs, weights, &mut packed);
            packed
        })
        .collect()
}

/// Padding and bias of the second convolution, changed so that all its inputs are non-negative.
///
/// The kernels require non-negative inputs, but a padding value can be negative. Each input channel
/// therefore gets an offset, and the bias subtracts the offset's contribution to the sums.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnsignedInput {
    /// Offset that is added to all inputs of each channel, including the padding; >= 0.
    pub offset: [i16; CONV1_CHANNELS],
    /// Padding of each input channel, with the offset added.
    pub padding: [i16; CONV1_CHANNELS],
    /// Bias of each output channel, minus the contribution of the offsets to its sum.
    pub bias: Vec<i32>,
}

impl UnsignedInput {
    /// Computes offset, padding and bias. Every padding value of the model plus 255 must fit 16
    /// bits, as [`quantise`](crate::quantise()) guarantees.
    pub fn from_model(model: &IntegerModel) -> Self {
        let offset = model.hidden_padding.map(|padding| (-padding).max(0));
        let per_output = model.conv2.weights.len() / model.conv2.bias.len().max(1);
        let outputs = model.conv2.weights.chunks_exact(per_output.max(1));
        let bias = outputs.zip(&model.conv2.bias).map(|(weights, &bias)| {
            let channels = weights.as_chunks::<TAPS>().0.iter().zip(offset);
            channels.fold(bias, |bias, (weights, offset)| {
                let sum: i32 = weights.iter().map(|&weight| i32::from(weight)).sum();
                bias.wrapping_sub(sum * i32::from(offset))
            })
        });
        Self {
            offset,
            padding: std::array::from_fn(|channel| model.hidden_padding[channel] + offset[channel]),
            bias: bias.collect(),
        }
    }

    /// Returns the largest input of the second convolution after the offsets are added.
    pub fn largest(&self) -> u16 {
        let offsets = self.offset.iter().map(|offset| 255 + offset.unsigned_abs());
        let paddings = self.padding.iter().map(|padding| padding.unsigned_abs());
        offsets.chain(paddings).max().unwrap_or(0)
    }

    /// Packs one value for each channel into pairs of neighbouring channels.
    pub fn to_pairs(channels: [i16; CONV1_CHANNELS]) -> [Pair; HIDDEN_PAIRS] {
        let mut pairs = [Pair::ZERO; HIDDEN_PAIRS];
        Pair::fill(&mut pairs, channels.into_iter());
        pairs
    }
}
