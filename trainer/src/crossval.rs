//! Cross-validation: the test error of a model and of PCA, for each subject, over folds of whole
//! runs or of contiguous blocks.
//!
//! ```text
//! recordings --group--> Subject --deal--> Fold --fit, test--> Outcome, one file each
//!                                          |                        |
//!                                     shard K of N              merge: Table as Markdown, CSV, JSON
//! ```
//!
//! Each fold is tested with a model that was trained on the other folds of the same subject. No
//! window of a test fold overlaps a window of the training: folds consist of whole runs or of
//! blocks with a window left out between them, never of shuffled windows.
//!
//! Every outcome is a file of its own, so an interrupted cross-validation continues with the
//! missing folds, and several processes or machines can share the folds ([`Shard`]) and a folder.
//! The table depends on the outcomes alone.

mod fit;
mod outcome;
mod plan;
mod table;

use crate::card::{ModelOptions, description_to_compare};
use crate::error::TrainerError;
use crate::progress::ProgressObserver;
use crate::selection::{self, mains_hz};
use crate::subject::group;
use crate::track::{Track, read_tracks};
use crate::training::Settings;
use clap::Args;
use std::path::{Path, PathBuf};

pub(crate) use outcome::Outcome;
use plan::{Fold, Shard};
pub(crate) use table::Table;
pub(crate) use table::columns;

/// Options of `trainer crossval`.
#[derive(Args, Clone, Debug)]
pub(crate) struct CrossvalOptions {
    /// Folder in which names of recordings are searched.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings (EDF, BDF, GDF) of all subjects: files, folders, patterns such as 'S001*.edf',
    /// ends of the names of files in --data, or ranges of them like R03..R12 [default: all in
    /// --data].
    #[arg(long, value_delimiter = ',')]
    recordings: Vec<String>,
    /// Name of the only subject [default: what precedes the number of the run in the files' names].
    #[arg(long)]
    subject: Option<String>,
    #[command(flatten)]
    model: ModelOptions,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long = "mains", value_name = "MAINS", value_parser = mains_hz)]
    mains_hz: u32,
    #[command(flatten)]
    settings: Settings,
    /// Number of folds of each repetition.
    #[arg(long, default_value_t = 3)]
    folds: usize,
    /// Number of repetitions, each with another split into folds.
    #[arg(long, default_value_t = 3)]
    repetitions: usize,
    /// Number of contiguous blocks of each recording to deal to the folds; 1 deals whole runs
    /// [default: 1 where a subject has a run for each fold, otherwise enough for two blocks in each
    /// fold].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=100))]
    blocks: Option<u16>,
    /// Compute only shard K of N of the folds. Shards may share the folder.
    #[arg(long, value_name = "K/N", default_value = "1/1")]
    shard: Shard,
    /// Folder of the outcomes and of the table. Folds whose outcome is there are not computed
    /// again.
    #[arg(long)]
    pub(crate) out: PathBuf,
}

/// Computes the folds of the shard whose outcomes are missing, and writes each outcome. Returns the
/// table if the outcomes of all shards are there, else `None`.
///
/// # Errors
/// If a recording cannot be used, a subject has too little data, or a file cannot be written.
pub(crate) fn run(
    options: &CrossvalOptions,
    observer: &mut impl ProgressObserver,
) -> Result<Option<Table>, TrainerError> {
    let recordings = match options.recordings.as_slice() {
        [] => selection::all_in(&options.data)?,
        names => selection::recordings(&options.data, names)?,
    };
    let montage = options.model.montage()?;
    let description = description_to_compare(&montage, options.model.shape)?;
    let identity = |fold: &Fold| identity(options, &montage.name, fold);
    let subjects = group(&recordings, options.subject.as_deref());
    outcome::prepare(&options.out)?;
    let mut plan = Vec::new();
    for subject in &subjects {
        for fold in plan::folds(subject, options)? {
            plan.push((subject, fold));
        }
    }
    let own = plan.iter().enumerate();
    let own = own.filter(|(index, _)| options.shard.contains(*index));
    let own: Vec<_> = own.map(|(_, fold)| fold).collect();
    let mut tracks: Option<(&str, Vec<Track>)> = None;
    for (number, (subject, fold)) in own.iter().enumerate() {
        let settings = identity(fold);
        if outcome::read(&options.out, fold, &settings)?.is_some() {
            observer.message(&format!("{}: done before", fold.name()));
            continue;
        }
        // Only the recordings of one subject are in memory at the same time.
        if tracks
            .as_ref()
            .is_none_or(|(name, _)| *name != subject.name)
        {
            drop(tracks.take());
            let read = read_tracks(
                &subject.recordings,
                &description,
                options.mains_hz,
                observer,
            )?;
            tracks = Some((&subject.name, read));
        }
        observer.fold_started(&fold.name(), number + 1, own.len());
        if let Some((_, tracks)) = &tracks {
            let mut outcome =
                fit::test_fold(tracks, fold, &description, options.settings, observer)?;
            outcome.settings = settings;
            outcome.write(&options.out)?;
            observer.fold_finished(&outcome);
        }
    }
    let mut outcomes = Vec::new();
    for (_, fold) in &plan {
        match outcome::read(&options.out, fold, &identity(fold))? {
            Some(outcome) => outcomes.push(outcome),
            None => return Ok(None),
        }
    }
    let table = Table::new(outcomes)?;
    table.write(&options.out)?;
    Ok(Some(table))
}

/// Makes the table from the outcomes in the folders of all shards, and writes it to `out`.
///
/// # Errors
/// If outcomes are missing, exist twice with different contents, or belong to different settings.
pub(crate) fn merge(folders: &[PathBuf], out: &Path) -> Result<Table, TrainerError> {
    let table = Table::new(outcome::read_all(folders)?)?;
    outcome::prepare(out)?;
    for outcome in table.outcomes() {
        outcome.write(out)?;
    }
    table.write(out)?;
    Ok(table)
}

/// Returns as text all settings that determine an outcome, except the number of the fold. All
/// outcomes of a subject in a table have the same text.
fn identity(options: &CrossvalOptions, montage: &str, fold: &Fold) -> String {
    format!(
        "montage {montage}, {}, codes {}, mains {} Hz; {} epochs in {}; {} folds of {} in {} repetitions",
        options.model.shape,
        options.model.shape.format,
        options.mains_hz,
        options.settings.epochs,
        options.settings,
        options.folds,
        fold.kind(),
        options.repetitions
    )
}
