//! The int8 kernels with small random layers, at the ends of their ranges as often as in between.
//! `build.rs` has this file, too.

use int8_nn::{Direct, Linear, Pair, PlaneShape, Winograd};

use crate::signal::Noise;

/// Layers of each kind.
const LAYERS: usize = 6;

/// Pairs of channels before a convolution, as the assembler wants them; columns there; channels behind it.
const PAIRS: usize = 8;
const COLUMNS: usize = 6;
const OUTPUTS: usize = 2;
/// Weights of a convolution.
const TAPS: usize = 27 * 2 * PAIRS * OUTPUTS;

/// Pairs of inputs and outputs of a fully connected layer.
const INPUTS: usize = 32;
const SUMS: usize = 8;

type Conv<'w> = Winograd<'w, PAIRS, COLUMNS>;
type Plain<'w> = Direct<'w, PAIRS, COLUMNS>;

/// Rows of four columns, pooled by two and two.
const WINOGRAD: Conv<'_> = Winograd {
    tile_rows: 1,
    outputs: OUTPUTS,
    weights: &[],
};
const WINOGRAD_SUMS: usize = WINOGRAD.pooled().len();
/// The same, pooled by one and four.
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

/// What all layers of all kinds sum up to.
pub(crate) const RESULTS: usize = LAYERS * (SUMS + WINOGRAD_SUMS + DIRECT_SUMS);

/// The sums of all layers: fully connected, Winograd's convolution, the direct one, and again.
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

/// A pool keeps what is larger than before.
fn pooled(sums: &mut [i32], pool: impl FnOnce(&mut [i32])) -> usize {
    sums.fill(i32::MIN);
    pool(sums);
    sums.len()
}

/// Any weight, at an end of its range once in four times.
fn weight(noise: &mut Noise) -> i8 {
    let [.., choice, any] = noise.next().to_le_bytes();
    match choice % 8 {
        0 => 127,
        1 => -127,
        _ => any.cast_signed().max(-127),
    }
}

/// Two activations, the first at its end once in four times.
fn activations(noise: &mut Noise) -> Pair {
    let [_, choice, first, second] = noise.next().to_le_bytes();
    let first = if choice.is_multiple_of(4) { 255 } else { first };
    Pair::new([first, second].map(i16::from))
}
