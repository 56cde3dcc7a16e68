//! Random models for the packed code, the compressed form of each hop.

use ::packed::{LEVELS, MAGNITUDES, RATES, Starts};
use artifact::{
    Description, IntegerMatrix, LARGEST_STATE, PackedDescription, PackedModel, PackedTraining,
    SUM_LIMIT, Smoother, slice_ends,
};

use crate::Noise;

/// Largest magnitude of a quantised input value of a packed block, levels.
const INPUT_LIMIT: i16 = 4095;

/// Returns a packed model with dense random matrices and frequencies, and with as many coefficients
/// as the description allows. The prediction matrix has a gain of about 0.1, so that the decoder's
/// state settles after a change.
pub fn any_packed(seed: u32, description: &Description) -> PackedModel {
    any_packed_of(256, seed, description)
}

/// Returns a packed model as [`any_packed`] does, but with at most `most` coefficients.
pub fn any_packed_of(most: usize, seed: u32, description: &Description) -> PackedModel {
    let mut noise = Noise(seed);
    let (electrodes, hop) = (description.montage.electrodes.len(), description.window.hop);
    let values = electrodes * hop;
    let coefficients = (values / 16 * 16).min(most);
    let mut matrix = |outputs: usize, inputs: usize, gain: f64| -> Vec<f64> {
        #[expect(clippy::cast_precision_loss, reason = "a few hundred")]
        let scale = gain / (inputs as f64).sqrt();
        (0..outputs * inputs).map(|_| f64::from(noise.next()) * scale).collect()
    };
    let (analysis, prediction) =
        (matrix(coefficients, values, 1.0), matrix(coefficients, coefficients, 0.1));
    let ends = slice_ends(electrodes, hop);
    PackedModel {
        description: PackedDescription {
            format: 1,
            coefficients,
            rate: 4,
            unit_uv: 0.5,
            input_limit: INPUT_LIMIT,
            misfit_uv2: 20.0,
            weight: None,
            training: PackedTraining::default(),
        },
        analysis: IntegerMatrix::quantised(&analysis, values, 1.0, |row| {
            let starts = [0].into_iter().chain(ends.iter().copied());
            let slices =
                starts.zip(&ends).map(|(start, &end)| scale(&row[start..end], INPUT_LIMIT));
            slices.fold(f64::INFINITY, f64::min)
        }),
        prediction: IntegerMatrix::quantised(&prediction, coefficients, 8.0, |row| {
            scale(row, LARGEST_STATE)
        }),
        predicted_levels: (0..coefficients).map(level).collect(),
        reset_levels: (0..coefficients).rev().map(level).collect(),
        starts: starts(&mut noise),
        smoother: Smoother {
            weights: vec![0; RATES * coefficients * coefficients],
            scales: vec![0.0; RATES * coefficients],
        },
        synthesis: None,
    }
}

/// Returns the largest scale for a row of weights such that the sum of the scaled and rounded
/// weights times inputs stays within `SUM_LIMIT`, for inputs of magnitude up to `limit`.
fn scale(weights: &[f64], limit: i16) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "below 2^24")]
    let most = (SUM_LIMIT / i64::from(limit)) as f64 - 0.5 * weights.len() as f64;
    most / weights.iter().map(|weight| weight.abs()).sum::<f64>().max(1e-9)
}

/// Returns an arbitrary level for a coefficient, from 20 to 51.
fn level(coefficient: usize) -> u8 {
    u8::try_from(20 + coefficient % 32).expect("below 64")
}

fn starts(noise: &mut Noise) -> Box<Starts> {
    let mut starts = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    for row in starts.iter_mut().flatten() {
        let mut start = 0;
        for place in row.iter_mut() {
            *place = start;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "1 to 2001"
            )]
            let count = (noise.next().abs() * 2000.0) as u16 + 1;
            start += count.min(2001);
        }
    }
    starts
}
