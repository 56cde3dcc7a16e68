//! Bits and error of a packed model at a rate.

use super::blocks::Blocks;
use super::coded::Coded;
use super::corrections::{columns, neighbourhoods};
use artifact::Correction;
use nalgebra::DMatrix;

/// Bits and error at one rate, measured on recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateFigures {
    /// The rate, 0..=15.
    pub rate: u8,
    /// Bits of a block, mean: its bytes times 8.
    pub bits: f64,
    /// Bytes of the longest block.
    pub longest: usize,
    /// Mean squared error without a correction, in units of `input.sd_uv` squared.
    pub mse_plain: f64,
    /// Mean squared error of the block's own state, corrected.
    pub mse: f64,
    /// Mean squared error one block later, corrected with the states around the block.
    pub mse_smoothed: f64,
}

/// Measures coded blocks; `synthesis` is `[value, coefficient]`. The first and last four blocks of each
/// sequence do not count.
pub(super) fn measure(
    blocks: &Blocks,
    coded: &[Coded],
    correction: &Correction,
    synthesis: &DMatrix<f32>,
    unit: f64,
) -> RateFigures {
    let count = synthesis.ncols();
    let causal = DMatrix::from_row_slice(count, count, &correction.causal);
    let smooth = DMatrix::from_row_slice(count, 3 * count, &correction.smooth);
    let mut errors = [0.0; 3];
    let mut values = 0.0_f64;
    for (blocks, coded) in blocks.sequences.iter().zip(coded) {
        let states = columns(&coded.states, count, unit);
        let inner = states.ncols().saturating_sub(2);
        let own = states.columns(1, inner).into_owned();
        let estimates = [
            own.clone(),
            &own + &causal * &own,
            &own + &smooth * neighbourhoods(&states),
        ];
        let original = blocks.columns(1, inner);
        for (error, estimate) in errors.iter_mut().zip(estimates) {
            let difference = synthesis * estimate - &original;
            let counted = difference.columns(3, inner.saturating_sub(6));
            *error += counted.iter().map(|&d| f64::from(d).powi(2)).sum::<f64>();
        }
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53")]
        let counted = (inner.saturating_sub(6) * blocks.nrows()) as f64;
        values += counted;
    }
    let [plain, causal, smoothed] = errors.map(|error| error / values.max(1.0));
    let lengths = || coded.iter().flat_map(|coded| &coded.bytes);
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53")]
    let bits = 8.0 * lengths().sum::<usize>() as f64 / lengths().count().max(1) as f64;
    RateFigures {
        rate: correction.rate,
        bits,
        longest: lengths().copied().max().unwrap_or(0),
        mse_plain: plain,
        mse: causal,
        mse_smoothed: smoothed,
    }
}
