//! From the layout in which weights are trained to the one in which the kernels read them.

use int8_nn::{InputConv, Linear, Pair, Winograd};

use artifact::COLUMNS;

use crate::integer_model::{
    CODE, CONV1, CONV2, ELECTRODES, FLAT, IntegerConv, IntegerLinear, POOLED, STEPS,
};

/// Pairs of channels between the convolutions.
const HIDDEN_PAIRS: usize = CONV1 / 2;
/// Columns there that the pool reaches.
const HIDDEN_COLUMNS: usize = 2 * POOLED[2] + 2;
/// Pairs of inputs from a pooled plane: a multiple of eight as it is.
const POOLED_PAIRS: usize = CONV2 * POOLED[1] * POOLED[2] / 2;
/// Pairs of inputs from a time step, filled up to a multiple of eight.
const ELECTRODE_PAIRS: usize = ELECTRODES.div_ceil(2).next_multiple_of(8);

/// Weights of the first convolution, as [`InputConv`] reads them.
pub fn input_convolution(conv: &IntegerConv) -> Vec<Pair> {
    let outputs = conv.bias.len();
    let mut packed = vec![Pair::ZERO; InputConv::<COLUMNS>::weights_len(outputs)];
    InputConv::<COLUMNS>::pack_weights(outputs, &by_tap(conv), &mut packed);
    packed
}

/// Weights of the second convolution, as [`Winograd`] reads them.
pub fn convolution(conv: &IntegerConv) -> Vec<Pair> {
    type Conv = Winograd<'static, HIDDEN_PAIRS, HIDDEN_COLUMNS>;
    let outputs = conv.bias.len();
    let mut transformed = vec![Pair::ZERO; Conv::weights_len(outputs)];
    Conv::transform_weights(outputs, &by_tap(conv), &mut transformed);
    transformed
}

/// `[tap][in][out]` from PyTorch's `[out][in][tap]`, tap = (time, row, column).
fn by_tap(conv: &IntegerConv) -> Vec<i8> {
    let outputs = conv.bias.len();
    let inputs = conv.weights.len() / (27 * outputs);
    (0..conv.weights.len())
        .map(|index| {
            let (tap, rest) = (index / (inputs * outputs), index % (inputs * outputs));
            let (input, output) = (rest / outputs, rest % outputs);
            conv.weights[(output * inputs + input) * 27 + tap]
        })
        .collect()
}

/// One matrix for each pooled plane `[position][channel]`, from PyTorch's
/// `[out][channel][plane][position]`.
pub fn fully_connected(linear: &IntegerLinear) -> Vec<Vec<Pair>> {
    let [planes, rows, columns] = POOLED;
    let positions = rows * columns;
    let weights: Vec<i8> = (0..FLAT * CODE)
        .map(|index| {
            let (input, output) = (index / CODE, index % CODE);
            let (plane, rest) = (input / (positions * CONV2), input % (positions * CONV2));
            let (position, channel) = (rest / CONV2, rest % CONV2);
            linear.weights[output * FLAT + (channel * planes + plane) * positions + position]
        })
        .collect();
    matrices(&weights, planes, POOLED_PAIRS)
}

/// One matrix for each time step, from PyTorch's `[out][step * 61 + electrode]`.
pub fn shortcut(linear: &IntegerLinear) -> Vec<Vec<Pair>> {
    let inputs = STEPS * ELECTRODES;
    let weights: Vec<i8> = (0..inputs * CODE)
        .map(|index| linear.weights[index % CODE * inputs + index / CODE])
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
