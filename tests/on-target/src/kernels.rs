//! Runs the int8 kernels on small random layers, in which extreme weights and activations are
//! frequent. `build.rs` includes this file as well.

use int8_nn::{Direct, Linear, Pair, PlaneShape, Winograd};

use crate::signal::Noise;

/// Number of random layers of each of the three kinds: fully connected, Winograd and direct.
const LAYERS: usize = 6;

/// Number of pairs of input channels of a convolution; the assembler kernels require 8.
const PAIRS: usize = 8;
/// Number of input columns of a convolution.
const COLUMNS: usize = 6;
/// Number of output channels of a convolution.
const OUTPUTS: usize = 2;
/// Number of weights per convolution: 3 x 3 x 3 for each input and output channel.
const TAPS: usize = 27 * 2 * PAIRS * OUTPUTS;

/// Number of pairs of inputs of a fully connected layer.
const INPUTS: usize = 32;
/// Number of outputs of a fully connected layer.
const SUMS: usize = 8;

type Conv<'w> = Winograd<'w, PAIRS, COLUMNS>;
type Plain<'w> = Direct<'w, PAIRS, COLUMNS>;

/// Winograd convolution without weights: 2 rows and 4 columns of sums per output channel,
/// max-pooled over 2 rows and 2 columns.
const WINOGRAD: Conv<'_> = Winograd {
    tile_rows: 1,
    outputs: OUTPUTS,
    weights: &[],
};
const WINOGRAD_SUMS: usize = WINOGRAD.pooled().len();
/// Direct convolution without weights: 2 rows and 4 columns of sums per output channel, max-pooled
/// over 1 row and 4 columns.
const DIRECT: Plain<'_> = Direct {
    pool: [1, 4],
    pooled: PlaneShape {
        rows: 2,
        columns: 1,
        channels: OUTPUTS,
    },
    weights: &[],
};
const DIRECT_SUMS: usize = DIRECT.pooled.len();

/// Number of outputs of all random layers together.
pub(crate) const RESULTS: usize = LAYERS * (SUMS + WINOGRAD_SUMS + DIRECT_SUMS);

/// Returns the outputs of all random layers: [`LAYERS`] times the outputs of a fully connected
/// layer, a Winograd convolution and a direct convolution.
pub(crate) fn results() -> [i32; RESULTS] {
    let mut noise = Noise(11);
    let mut results = [0; RESULTS];
    let mut rest = &mut results[..];
    for _ in 0..LAYERS {
        for layer in [linear, winograd, direct] {
            let sums = layer(&mut noise, rest);
            rest = &mut core::mem::take(&mut rest)[sums..];
        }
    }
    results
}

#[inline(never)]
fn linear(noise: &mut Noise, sums: &mut [i32]) -> usize {
    let weights: [i8; 2 * INPUTS * SUMS] = core::array::from_fn(|_| weight(noise));
    let mut packed = [Pair::ZERO; INPUTS * SUMS / 2];
    Linear::pack_weights(INPUTS, SUMS, &weights, &mut packed);
    let layer = Linear {
        inputs: INPUTS,
        outputs: SUMS,
        weights: &packed,
    };
    let inputs: [Pair; INPUTS] = core::array::from_fn(|_| activations(noise));
    layer.accumulate(&inputs, sums);
    SUMS
}

#[inline(never)]
fn winograd(noise: &mut Noise, sums: &mut [i32]) -> usize {
    let weights: [i8; TAPS] = core::array::from_fn(|_| weight(noise));
    let mut packed = [Pair::ZERO; Conv::weights_len(OUTPUTS)];
    Conv::transform_weights(OUTPUTS, &weights, &mut packed);
    let conv = Winograd {
        weights: &packed,
        ..WINOGRAD
    };
    let mut planes = [[Pair::ZERO; WINOGRAD.transformed_len()]; 3];
    for plane in &mut planes {
        let input: [Pair; WINOGRAD.input().len() / 2] =
            core::array::from_fn(|_| activations(noise));
        conv.transform(&input, plane);
    }
    pooled(&mut sums[..WINOGRAD_SUMS], |largest| {
        conv.convolve_max_pool(planes.each_ref().map(|plane| &plane[..]), largest);
    })
}

#[inline(never)]
fn direct(noise: &mut Noise, sums: &mut [i32]) -> usize {
    let weights: [i8; TAPS] = core::array::from_fn(|_| weight(noise));
    let mut packed = [Pair::ZERO; Plain::weights_len(OUTPUTS)];
    Plain::pack_weights(OUTPUTS, &weights, &mut packed);
    let conv = Direct {
        weights: &packed,
        ..DIRECT
    };
    let mut planes = [[Pair::ZERO; DIRECT.transformed_len()]; 3];
    for plane in &mut planes {
        let input: [Pair; DIRECT.input().len() / 2] = core::array::from_fn(|_| activations(noise));
        conv.transform(&input, plane);
    }
    pooled(&mut sums[..DIRECT_SUMS], |largest| {
        conv.convolve_max_pool(planes.each_ref().map(|plane| &plane[..]), largest);
    })
}

/// Sets all `sums` to the smallest value, so that `pool` can raise them, and returns their number.
fn pooled(sums: &mut [i32], pool: impl FnOnce(&mut [i32])) -> usize {
    sums.fill(i32::MIN);
    pool(sums);
    sums.len()
}

/// Draws a weight from -127 to 127. With a probability of at least 1/4 it is one of these extremes.
fn weight(noise: &mut Noise) -> i8 {
    let [.., choice, any] = noise.next().to_le_bytes();
    match choice % 8 {
        0 => 127,
        1 => -127,
        _ => any.cast_signed().max(-127),
    }
}

/// Draws a pair of activations from 0 to 255. The first is 255 with a probability of at least 1/4.
fn activations(noise: &mut Noise) -> Pair {
    let [_, choice, first, second] = noise.next().to_le_bytes();
    let first = if choice.is_multiple_of(4) { 255 } else { first };
    Pair::new([first, second].map(i16::from))
}
