//! From the layout in which weights are trained to the one in which the kernels read them.

use crate::integer_model::{
    CODE, CONV2, ELECTRODES, FLAT, IntegerConv, IntegerLinear, POOLED, STEPS,
};

/// `[tap][in][out]` from PyTorch's `[out][in][tap]`, tap = (time, row, column).
pub fn convolution(conv: &IntegerConv) -> Vec<i8> {
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

/// One `[position][channel][out]` matrix for each pooled plane, from PyTorch's
/// `[out][channel][plane][position]`.
pub fn fully_connected(linear: &IntegerLinear) -> Vec<Vec<i8>> {
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
    split(&weights, planes)
}

/// One `[electrode][out]` matrix for each time step, from PyTorch's `[out][step * 61 + electrode]`.
pub fn shortcut(linear: &IntegerLinear) -> Vec<Vec<i8>> {
    let inputs = STEPS * ELECTRODES;
    let weights: Vec<i8> = (0..inputs * CODE)
        .map(|index| linear.weights[index % CODE * inputs + index / CODE])
        .collect();
    split(&weights, STEPS)
}

fn split(weights: &[i8], parts: usize) -> Vec<Vec<i8>> {
    weights
        .chunks_exact(weights.len() / parts)
        .map(<[i8]>::to_vec)
        .collect()
}
