//! Plan of a cross-validation: the folds of each subject, and the shards of the folds.

use super::CrossvalOptions;
use crate::error::TrainerError;
use crate::selection::file_name;
use crate::subject::Subject;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;
use std::str::FromStr;

/// Blocks of a subject on which a model is tested after training on the subject's other blocks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fold {
    pub(crate) subject: String,
    /// Number of the repetition, from 1.
    pub(crate) repetition: usize,
    /// Number of the fold within the repetition, from 1.
    pub(crate) number: usize,
    /// Number of blocks into which each recording is divided; 1 for whole runs.
    pub(crate) blocks: usize,
    /// Blocks on which the model is tested, in ascending order.
    pub(crate) test: Vec<Block>,
    /// File names of the subject's recordings.
    pub(crate) recordings: Vec<String>,
    /// Number of blocks that the model is trained on. The fold's computing time is about
    /// proportional to this number.
    pub(crate) trained_on: usize,
}

/// A contiguous part of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Block {
    /// Index of the recording among the subject's recordings.
    pub(crate) recording: usize,
    /// Index of the block in its recording.
    pub(crate) block: usize,
}

impl Fold {
    /// Returns the name of the fold and of its outcome file.
    pub(crate) fn name(&self) -> String {
        format!("{}-r{}-f{}", self.subject, self.repetition, self.number)
    }

    /// Returns a text that states what is distributed over the folds: whole runs, or blocks of
    /// runs.
    pub(crate) fn kind(&self) -> String {
        if self.blocks == 1 {
            "whole runs".to_owned()
        } else {
            format!("blocks, {} in each run", self.blocks)
        }
    }

    /// Returns a text that lists what the model is tested on: runs, each with the number of its
    /// block (from 1) if runs are divided into blocks.
    pub(crate) fn tested_on(&self) -> String {
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

/// Returns the folds of all subjects; one fold for each subject if one subject is left out at a
/// time.
///
/// # Errors
/// If [`folds`] fails; [`TrainerError::OnePerson`] if the only subject would have to be left out.
pub(super) fn plan(
    subjects: &[Subject],
    options: &CrossvalOptions,
) -> Result<Vec<Fold>, TrainerError> {
    if !options.leave_one_person_out {
        let folds = subjects.iter().map(|subject| folds(subject, options));
        return Ok(folds.collect::<Result<Vec<_>, _>>()?.concat());
    }
    if let [subject] = subjects {
        return Err(TrainerError::OnePerson(subject.name.clone()));
    }
    let runs = subjects.iter().map(|subject| subject.recordings.len());
    let all: usize = runs.sum();
    let fold = |subject: &Subject| Fold {
        subject: subject.name.clone(),
        repetition: 1,
        number: 1,
        blocks: 1,
        test: blocks(subject, 1),
        recordings: file_names(subject),
        trained_on: all - subject.recordings.len(),
    };
    Ok(subjects.iter().map(fold).collect())
}

/// Returns all blocks of a subject, whose recordings have `blocks` blocks each.
fn blocks(subject: &Subject, blocks: usize) -> Vec<Block> {
    let recordings = 0..subject.recordings.len();
    recordings
        .flat_map(|recording| (0..blocks).map(move |block| Block { recording, block }))
        .collect()
}

fn file_names(subject: &Subject) -> Vec<String> {
    let files = subject.recordings.iter();
    files.map(|file| file_name(file)).collect()
}

/// Returns the folds of all repetitions of a subject. In each repetition the blocks are dealt to
/// the folds in a random order, which depends only on seed and repetition.
///
/// # Errors
/// If there are fewer blocks than folds, or fewer than two folds.
fn folds(subject: &Subject, options: &CrossvalOptions) -> Result<Vec<Fold>, TrainerError> {
    let runs = subject.recordings.len();
    let enough = (2 * options.folds).div_ceil(runs.max(1));
    let default = if runs >= options.folds { 1 } else { enough };
    let blocks = options.blocks.map_or(default, usize::from);
    if options.folds < 2 || runs * blocks < options.folds {
        return Err(TrainerError::TooFewBlocks {
            subject: subject.name.clone(),
            blocks: runs * blocks,
            folds: options.folds,
        });
    }
    let all = self::blocks(subject, blocks);
    let mut folds = Vec::new();
    for repetition in 1..=options.repetitions {
        let mut rng = ChaCha8Rng::seed_from_u64(options.settings.seed);
        rng.set_stream(repetition as u64);
        let mut dealt = all.clone();
        dealt.shuffle(&mut rng);
        for fold in 0..options.folds {
            let test = dealt.iter().skip(fold).step_by(options.folds);
            let mut test: Vec<Block> = test.copied().collect();
            test.sort_unstable();
            folds.push(Fold {
                subject: subject.name.clone(),
                repetition,
                number: fold + 1,
                blocks,
                trained_on: all.len() - test.len(),
                test,
                recordings: file_names(subject),
            });
        }
    }
    Ok(folds)
}

/// Shard K of N of a cross-validation: every N-th fold, from the K-th on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// Index of the shard, from 0.
    index: usize,
    count: usize,
}

impl Shard {
    /// Returns whether the shard contains the fold with index `fold`, from 0.
    pub(crate) fn contains(&self, fold: usize) -> bool {
        fold % self.count == self.index
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let error = || format!("{text} is no shard; write K/N with 1 <= K <= N, such as 2/8");
        let (number, count) = text.split_once('/').ok_or_else(error)?;
        let number: usize = number.parse().map_err(|_| error())?;
        let count: usize = count.parse().map_err(|_| error())?;
        if number < 1 || number > count {
            return Err(error());
        }
        Ok(Self { index: number - 1, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_text_is_refused_with_an_example() {
        for text in ["0/3", "4/3", "3", "a/b", "1/0", "-1/2"] {
            let error = text.parse::<Shard>().unwrap_err();
            assert!(error.contains(text) && error.contains("2/8"), "{error}");
        }
    }
}
