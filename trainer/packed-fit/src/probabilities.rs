//! Levels, which represent mean magnitudes, and initial frequencies of the magnitudes.

use crate::coded::{Coded, Histogram};
use packed::{FREQUENCY_BITS, LEVELS, MAGNITUDES, Starts};

/// Mean magnitude that level 0 represents.
const LEAST_MEAN: f64 = 0.0015;

/// Highest level.
const LAST_LEVEL: f64 = 63.0;

/// Weight of the distribution that is assumed for a level, as a number of magnitudes. The
/// distribution, multiplied by this weight, is added to the counts of the magnitudes that were
/// coded at the level.
const ASSUMED: f64 = 20.0;

/// Returns the natural logarithm of the ratio of the mean magnitudes of two neighbouring levels.
fn log_ratio() -> f64 {
    8000_f64.ln() / 55.0
}

/// Returns the level nearest to each mean magnitude.
pub(crate) fn levels(means: &[f64]) -> Vec<u8> {
    let level = |&mean: &f64| {
        let level = ((mean.max(1e-5).ln() - LEAST_MEAN.ln()) / log_ratio()).round();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 0..=63"
        )]
        let level = level.clamp(0.0, LAST_LEVEL) as u8;
        level
    };
    means.iter().map(level).collect()
}

/// Returns, for each of `count` coefficients, the mean of `size` over all blocks except the first
/// block of each sequence.
fn means<'s, T: 's>(
    sequences: impl Iterator<Item = &'s [T]>,
    count: usize,
    size: impl Fn(&T) -> f64,
) -> Vec<f64> {
    let mut means = vec![0.0; count];
    let mut blocks = 0.0_f64;
    for block in sequences.flat_map(|sequence| sequence.chunks_exact(count).skip(1)) {
        blocks += 1.0;
        for (mean, value) in means.iter_mut().zip(block) {
            *mean += size(value);
        }
    }
    means.iter().map(|sum| sum / blocks.max(1.0)).collect()
}

/// Returns the mean magnitude of each coefficient over all blocks except the first of each
/// sequence.
pub(crate) fn mean_magnitudes(coded: &[Coded], count: usize) -> Vec<f64> {
    let magnitudes = coded.iter().map(|coded| coded.magnitudes.as_slice());
    means(magnitudes, count, |magnitude| magnitude.unsigned_abs().into())
}

/// Estimates the mean magnitude that each coefficient would have if every block were coded without
/// prediction. The first block of each sequence is left out. `two_steps` is twice the quantiser
/// step and corresponds to magnitude 1; 0.2 is subtracted for the quantiser's dead zone.
pub(crate) fn mean_sizes(coefficients: &[Vec<i16>], count: usize, two_steps: f64) -> Vec<f64> {
    let coefficients = coefficients.iter().map(Vec::as_slice);
    let size = |coefficient: &i16| (f64::from(*coefficient).abs() / two_steps - 0.2).max(0.0);
    let means = means(coefficients, count, size);
    means.iter().map(|mean| mean + 0.0005).collect()
}

/// Returns the initial frequencies of the magnitudes: the counts, plus an assumed geometric
/// distribution that has the level's mean and the weight of [`ASSUMED`] magnitudes.
pub(crate) fn starts(histogram: &Histogram) -> Box<Starts> {
    let mut table = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    for (rows, counts) in table.iter_mut().zip(histogram) {
        for ((level, row), counts) in (0..).zip(rows).zip(counts) {
            let mean = LEAST_MEAN * (log_ratio() * f64::from(level)).exp();
            let ratio = mean / (1.0 + mean);
            let assumed = (0..).map(|magnitude| ratio.powi(magnitude));
            let sum: f64 = assumed.clone().take(MAGNITUDES).sum();
            let weights = counts
                .iter()
                .zip(assumed)
                .map(|(&count, assumed)| f64::from(count) + ASSUMED * assumed / sum);
            *row = row_starts(&weights.collect::<Vec<_>>());
        }
    }
    table
}

/// Returns the initial frequencies of a table's row: in proportion to the weights, each at least 1.
/// The most frequent magnitude absorbs the rounding error, so that the frequencies have the
/// required sum.
fn row_starts(weights: &[f64]) -> [u16; MAGNITUDES] {
    let total: f64 = weights.iter().sum();
    let all = f64::from(1_u32 << FREQUENCY_BITS);
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^15")]
    let mut counts: Vec<i32> =
        weights.iter().map(|weight| (weight / total * all).round().max(1.0) as i32).collect();
    let mut likeliest = 0;
    for (magnitude, weight) in weights.iter().enumerate() {
        if *weight > weights[likeliest] {
            likeliest = magnitude;
        }
    }
    counts[likeliest] += (1 << FREQUENCY_BITS) - counts.iter().sum::<i32>();
    let mut starts = [0; MAGNITUDES];
    let mut start = 0;
    for (place, count) in starts.iter_mut().zip(counts) {
        *place = u16::try_from(start).expect("frequencies sum to 2^15");
        start += count;
    }
    starts
}
