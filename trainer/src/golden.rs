//! Generates golden windows, for which every integer encoder must return the same codes.

use artifact::{Dimensions, Golden};
use model_gen::IntegerModel;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::TAU;

/// Amplitudes of the noise windows, as fractions of the input's range; windows with the last two
/// amplitudes clip.
const AMPLITUDES: [f32; 6] = [0.01, 0.05, 0.1, 0.2, 0.5, 1.5];
/// Number of noise windows at each amplitude.
const WINDOWS_PER_AMPLITUDE: usize = 3;
/// Seed of the noise windows.
const SEED: u64 = 0x60_1D;

/// Returns synthetic windows (extremes and noise), and the codes that model-gen's integer reference
/// computes for them.
pub(crate) fn golden_windows(integers: &IntegerModel) -> Golden {
    let cells: Vec<usize> = integers.cells.iter().map(|&cell| usize::from(cell)).collect();
    let dimensions = integers.geometry.dimensions;
    let mut windows = extremes(&cells, &dimensions);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for amplitude in AMPLITUDES {
        let noise = |_| noise(&cells, &dimensions, amplitude, &mut rng);
        windows.extend((0..WINDOWS_PER_AMPLITUDE).map(noise));
    }
    let codes = windows.iter().map(|window| integers.encode_window(window)).collect();
    Golden {
        format: integers.code_format,
        window_shape: [dimensions.steps, dimensions.cells()],
        windows,
        codes,
    }
}

/// Returns ten windows: zeros, each rail, three patterns that alternate between the rails in time,
/// in space and in both, and four single impulses.
fn extremes(cells: &[usize], dimensions: &Dimensions) -> Vec<Vec<i8>> {
    let window_of = |f: &dyn Fn(usize, usize) -> i8| {
        let mut window = vec![0; dimensions.window_cells()];
        for (step, plane) in window.chunks_mut(dimensions.cells()).enumerate() {
            for (electrode, &cell) in cells.iter().enumerate() {
                plane[cell] = f(step, electrode);
            }
        }
        window
    };
    let rails = |high: bool| if high { i8::MAX } else { i8::MIN };
    let mut windows = vec![
        window_of(&|_, _| 0),
        window_of(&|_, _| i8::MAX),
        window_of(&|_, _| i8::MIN),
        window_of(&|step, _| rails(step % 2 == 0)),
        window_of(&|_, electrode| rails(electrode % 2 == 0)),
        window_of(&|step, electrode| rails((step + electrode) % 2 == 0)),
    ];
    let (steps, electrodes) = (dimensions.steps, dimensions.electrodes);
    // Impulses at the first value of the window, at two values near its middle, and at the last
    // value.
    for (at_step, at_electrode) in [
        (0, 0),
        (steps / 2 - 1, electrodes / 2 - 1),
        (steps / 2, (5 * electrodes - 1) / 12),
        (steps - 1, electrodes - 1),
    ] {
        windows.push(window_of(&|step, electrode| {
            if (step, electrode) == (at_step, at_electrode) { i8::MAX } else { 0 }
        }));
    }
    windows
}

/// Returns a window of 12 plane waves over the scalp grid, whose amplitudes fall as 1 / frequency,
/// plus white noise in each electrode.
fn noise(cells: &[usize], dimensions: &Dimensions, amplitude: f32, rng: &mut impl Rng) -> Vec<i8> {
    let columns = dimensions.columns;
    let mut window = vec![0.0_f32; dimensions.window_cells()];
    for harmonic in 1..=12_u8 {
        let frequency = f32::from(harmonic) / 32.0;
        let (phase, tilt) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU));
        for (step, plane) in (0_u8..).zip(window.chunks_mut(dimensions.cells())) {
            for &cell in cells {
                let place = tilt + 0.3 * (cell % columns) as f32 + 0.2 * (cell / columns) as f32;
                let wave = (TAU * frequency * f32::from(step) + phase + place).sin();
                plane[cell] += wave / f32::from(harmonic) + rng.random_range(-0.05..0.05);
            }
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "saturates, as the device does")]
    window.into_iter().map(|value| (value * amplitude * 127.0).round() as i8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn golden_windows_reach_both_rails_keep_empty_cells_0_and_are_reproducible() {
        let parameters = testing::pca();
        let data = testing::dataset(1, 64);
        let model = testing::model(&parameters, &data);
        let integers = model_gen::quantise(&model).unwrap();
        let golden = golden_windows(&integers);
        assert_eq!(golden.windows.len(), 10 + AMPLITUDES.len() * WINDOWS_PER_AMPLITUDE);
        let values = || golden.windows.iter().flatten();
        assert!(values().any(|q| *q == i8::MAX));
        assert!(values().any(|q| *q == i8::MIN));
        let cells = model.description.dimensions().cells();
        let mut planes = golden.windows.iter().flat_map(|window| window.chunks(cells));
        assert!(planes.all(|plane| plane[0] == 0 && plane[cells - 1] == 0));
        for (window, code) in golden.windows.iter().zip(&golden.codes) {
            assert_eq!(integers.encode_window(window), *code);
        }
        assert_eq!(golden_windows(&integers), golden);
    }
}
