//! Sequences of consecutive blocks, cut from tracks.

use crate::track::Track;
use nalgebra::DMatrix;

/// Consecutive blocks of one or several recordings. A block is a hop of time steps.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// One matrix for each sequence: each column is a block, in the order step, electrode, in units of
    /// `input.sd_uv`.
    pub(super) sequences: Vec<DMatrix<f32>>,
}

impl Blocks {
    /// Cuts tracks into blocks of `hop` steps, once from each of the first steps in `offsets`. So the statistics
    /// do not depend on where the first block begins.
    pub(super) fn cut(tracks: &[Track], hop: usize, sd_uv: f64, offsets: &[usize]) -> Self {
        let sequences = offsets.iter().flat_map(|&offset| {
            tracks.iter().map(move |track| {
                let block = hop * track.electrodes;
                let values = track.values.get(offset * track.electrodes..).unwrap_or(&[]);
                let count = values.len() / block;
                let scaled = values.iter().map(|&uv| {
                    #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
                    let value = (f64::from(uv) / sd_uv) as f32;
                    value
                });
                DMatrix::from_iterator(block, count, scaled.take(count * block))
            })
        });
        Self {
            sequences: sequences.collect(),
        }
    }
}
