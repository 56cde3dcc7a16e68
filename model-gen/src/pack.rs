//! From the layout in which weights are trained to the one in which the kernels read them.

use artifact::{CELLS, CODE, ELECTRODES, STEPS};
use int8_nn::{Direct, InputConv, Linear, Pair, Winograd};

use crate::{
    conv_kernel::ConvKernel,
    integer_model::{CONV1, CONV2, IntegerConv, IntegerModel},
};

/// Pairs of channels between the convolutions.
const HIDDEN_PAIRS: usize = CONV1 / 2;
/// Pairs of inputs from a time step, filled up to a multiple of eight.
const ELECTRODE_PAIRS: usize = ELECTRODES.div_ceil(2).next_multiple_of(8);

/// Weights of the first convolution, as [`InputConv`] reads them.
pub fn input_convolution(conv: &IntegerConv) -> Vec<Pair> {
    // They do not depend on the columns.
    type Conv = InputConv<'static, CELLS>;
    let outputs = conv.bias.len();
    let mut packed = vec![Pair::ZERO; Conv::weights_len(outputs)];
    Conv::pack_weights(outputs, &by_tap(conv), &mut packed);
    packed
}

/// Weights of the second convolution, as its kernel reads them.
pub fn convolution(model: &IntegerModel) -> Vec<Pair> {
    // They do not depend on the columns.
    type Transformed = Winograd<'static, HIDDEN_PAIRS, 6>;
    type Plain = Direct<'static, HIDDEN_PAIRS, 6>;
    let (outputs, weights) = (model.conv2.bias.len(), by_tap(&model.conv2));
    let kernel = ConvKernel::of(model);
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

/// `[tap][in][out]` from PyTorch's `[out][in][tap]`, tap = (time, row, column).
fn by_tap(conv: &IntegerConv) -> Vec<i8> {
    let outputs = conv.bias.len();
    let per_tap = conv.weights.len() / 27;
    (0..conv.weights.len())
        .map(|index| {
            let (tap, rest) = (index / per_tap, index % per_tap);
            let (input, output) = (rest / outputs, rest % outputs);
            conv.weights[(output * per_tap / outputs + input) * 27 + tap]
        })
        .collect()
}

/// For each pooled plane `[position][channel]` its pieces, from PyTorch's
/// `[out][channel][plane][position]`; none without convolutions.
pub fn fully_connected(model: &IntegerModel) -> Vec<Vec<Vec<Pair>>> {
    if !model.mode.has_convolutions() {
        return Vec::new();
    }
    let [planes, rows, columns] = model.geometry.pooled;
    let positions = rows * columns;
    let flat = model.geometry.flat();
    let weights: Vec<i8> = (0..flat * CODE)
        .map(|index| {
            let (input, output) = (index / CODE, index % CODE);
            let (plane, rest) = (input / (positions * CONV2), input % (positions * CONV2));
            let (position, channel) = (rest / CONV2, rest % CONV2);
            model.fc.weights[output * flat + (channel * planes + plane) * positions + position]
        })
        .collect();
    let pieces = fc_pieces(model);
    let pairs = positions * CONV2 / 2 / pieces;
    let mut matrices = matrices(&weights, planes * pieces, pairs).into_iter();
    (0..planes)
        .map(|_| matrices.by_ref().take(pieces).collect())
        .collect()
}

/// Matrices for a pooled plane: the fewest equal ones, of whole eights of pairs, that [`Linear`]
/// takes.
pub fn fc_pieces(model: &IntegerModel) -> usize {
    let [_, rows, columns] = model.geometry.pooled;
    let pairs = rows * columns * CONV2 / 2;
    let fewest = pairs.div_ceil(Linear::MOST_INPUTS);
    (fewest..=pairs)
        .find(|pieces| pairs.is_multiple_of(8 * pieces))
        .unwrap_or(pairs)
}

/// One matrix for each time step, from PyTorch's `[out][step * 61 + electrode]`; none without a
/// shortcut.
pub fn shortcut(model: &IntegerModel) -> Vec<Vec<Pair>> {
    if !model.mode.has_shortcut() {
        return Vec::new();
    }
    let inputs = STEPS * ELECTRODES;
    let weights: Vec<i8> = (0..inputs * CODE)
        .map(|index| model.shortcut.weights[index % CODE * inputs + index / CODE])
        .collect();
    matrices(&weights, STEPS, ELECTRODE_PAIRS)
}

/// Equal parts of `[input][output]`, each for so many pairs of inputs.
fn matrices(weights: &[i8], parts: usize, pairs: usize) -> Vec<Vec<Pair>> {
    weights
        .chunks_exact(weights.len() / parts)
        .map(|weights| {
            let mut packed = vec![Pair::ZERO; pairs * CODE / 2];
            Linear::pack_weights(pairs, CODE, weights, &mut packed);
            packed
        })
        .collect()
}

/// Numbers of the second convolution's input without a sign, which its kernels ask for, although its
/// padding may stand below 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unsigned {
    /// What is added to each channel, padding included.
    pub offset: [i16; CONV1],
    /// Padding of each channel, with it.
    pub padding: [i16; CONV1],
    /// The bias that takes it out again.
    pub bias: Vec<i32>,
}

impl Unsigned {
    /// Of an encoder whose padding fits 16 bits together with 255, as quantising makes them.
    pub fn of(model: &IntegerModel) -> Self {
        let offset = model.hidden_padding.map(|padding| (-padding).max(0));
        let per_output = model.conv2.weights.len() / model.conv2.bias.len().max(1);
        let outputs = model.conv2.weights.chunks_exact(per_output.max(1));
        let bias = outputs.zip(&model.conv2.bias).map(|(weights, &bias)| {
            let channels = weights.as_chunks::<27>().0.iter().zip(offset);
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

    /// Largest number that the second convolution reads.
    pub fn largest(&self) -> u16 {
        let offsets = self.offset.iter().map(|offset| 255 + offset.unsigned_abs());
        let paddings = self.padding.iter().map(|padding| padding.unsigned_abs());
        offsets.chain(paddings).max().unwrap_or(0)
    }

    /// Channels in pairs.
    pub fn pairs(channels: [i16; CONV1]) -> [Pair; HIDDEN_PAIRS] {
        let mut pairs = [Pair::ZERO; HIDDEN_PAIRS];
        Pair::fill(&mut pairs, channels.into_iter());
        pairs
    }
}
