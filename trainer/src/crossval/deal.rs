//! Deals the runs or blocks of a subject to folds.

use super::options::CrossvalOptions;
use super::subject::Subject;
use crate::error::TrainerError;
use crate::selection::file_name;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;

/// A fold: what it is tested on. All other blocks of the subject train its model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fold {
    /// Name of the subject.
    pub subject: String,
    /// Number of the repetition, from 1.
    pub repetition: usize,
    /// Number of the fold within the repetition, from 1.
    pub fold: usize,
    /// Number of blocks into which each recording is divided; 1 for whole runs.
    pub blocks: usize,
    /// Blocks of the test, in their order.
    pub test: Vec<Block>,
    /// File names of the subject's recordings.
    pub recordings: Vec<String>,
}

/// A contiguous part of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Block {
    /// Index of the recording among those of the subject.
    pub recording: usize,
    /// Index of the block in its recording.
    pub block: usize,
}

impl Fold {
    /// Returns the name of the fold, which is also that of its file.
    pub fn name(&self) -> String {
        format!("{}-r{}-f{}", self.subject, self.repetition, self.fold)
    }

    /// Returns what the fold consists of, as text.
    pub fn kind(&self) -> String {
        if self.blocks == 1 {
            "whole runs".to_owned()
        } else {
            format!("blocks, {} in each run", self.blocks)
        }
    }

    /// Returns what the fold is tested on, as text: the runs, or the blocks of each run, from 1.
    pub fn tested_on(&self) -> String {
        let mut text = String::new();
        for block in &self.test {
            let separator = if text.is_empty() { "" } else { " " };
            let name = &self.recordings[block.recording];
            // Writing to a string cannot fail.
            let _ = write!(text, "{separator}{name}");
            if self.blocks > 1 {
                let _ = write!(text, "[{}/{}]", block.block + 1, self.blocks);
            }
        }
        text
    }
}

/// Returns the folds of all repetitions of a subject. Each repetition deals the blocks in another random
/// order, which depends on seed and repetition alone.
///
/// # Errors
/// If there are fewer blocks than folds, or a single fold.
pub(super) fn folds(
    subject: &Subject,
    options: &CrossvalOptions,
) -> Result<Vec<Fold>, TrainerError> {
    let runs = subject.recordings.len();
    let enough = (2 * options.folds).div_ceil(runs.max(1));
    let blocks = options
        .blocks
        .unwrap_or(if runs >= options.folds { 1 } else { enough });
    if options.folds < 2 || runs * blocks < options.folds {
        return Err(TrainerError::TooFewBlocks {
            subject: subject.name.clone(),
            blocks: runs * blocks,
            folds: options.folds,
        });
    }
    let all: Vec<Block> = (0..runs)
        .flat_map(|recording| (0..blocks).map(move |block| Block { recording, block }))
        .collect();
    let mut folds = Vec::new();
    for repetition in 1..=options.repetitions {
        let mut rng = ChaCha8Rng::seed_from_u64(options.settings.seed);
        rng.set_stream(repetition as u64);
        let mut dealt = all.clone();
        dealt.shuffle(&mut rng);
        for fold in 0..options.folds {
            let mut test: Vec<Block> = dealt
                .iter()
                .skip(fold)
                .step_by(options.folds)
                .copied()
                .collect();
            test.sort_unstable();
            folds.push(Fold {
                subject: subject.name.clone(),
                repetition,
                fold: fold + 1,
                blocks,
                test,
                recordings: subject
                    .recordings
                    .iter()
                    .map(|file| file_name(file))
                    .collect(),
            });
        }
    }
    Ok(folds)
}
