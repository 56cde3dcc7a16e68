//! Cross-validation: the test error of a model and of PCA, for each subject, over folds of whole runs or of
//! contiguous blocks.
//!
//! ```text
//! recordings --group--> Subject --deal--> Fold --fit, test--> Outcome, one file each
//!                                          |                        |
//!                                     shard K of N              merge: Table as Markdown, CSV, JSON
//! ```
//!
//! Each fold is tested with a model that was trained on the other folds of the same subject. No window of a
//! test fold overlaps a window of the training: folds consist of whole runs or of blocks with a window left
//! out between them, never of shuffled windows.
//!
//! Every outcome is a file of its own, so an interrupted cross-validation continues with the missing folds,
//! and several processes or machines can share the folds ([`Shard`]) and a folder. The table depends on the
//! outcomes alone.

mod deal;
mod fit;
mod observer;
mod options;
mod outcome;
mod shard;
mod subject;
mod table;

use crate::card::Shape;
use crate::error::TrainerError;
use crate::track::Track;
use crate::training::Settings;
use artifact::Description;
use std::path::PathBuf;

pub use deal::Fold;
pub use observer::CrossvalObserver;
pub use options::CrossvalOptions;
pub use outcome::{Errors, Outcome, Validation};
pub use shard::Shard;
pub use subject::{Subject, group};
pub use table::Table;
pub(crate) use table::columns;

/// Computes the folds of the shard whose outcomes are missing, and writes each outcome. Returns the table if
/// the outcomes of all shards are there, else `None`.
///
/// # Errors
/// If a recording cannot be used, a subject has too little data, or a file cannot be written.
pub fn run(
    options: &CrossvalOptions,
    observer: &mut impl CrossvalObserver,
) -> Result<Option<Table>, TrainerError> {
    let description = crate::card::description_to_compare(&options.montage, options.shape)?;
    let subjects = group(&options.recordings, options.subject.as_deref());
    outcome::prepare(&options.out)?;
    let mut plan = Vec::new();
    for subject in &subjects {
        for fold in deal::folds(subject, options)? {
            plan.push((subject, fold));
        }
    }
    let shards = plan.iter().enumerate();
    let own: Vec<_> = shards
        .filter(|(index, _)| options.shard.contains(*index))
        .map(|(_, fold)| fold)
        .collect();
    let mut tracks: Option<(&str, Vec<Track>)> = None;
    for (number, (subject, fold)) in own.iter().enumerate() {
        let settings = identity(options, fold);
        if outcome::read(&options.out, fold, &settings)?.is_some() {
            observer.message(&format!("{}: done before", fold.name()));
            continue;
        }
        // The recordings of one subject are in memory at a time.
        if tracks
            .as_ref()
            .is_none_or(|(name, _)| *name != subject.name)
        {
            drop(tracks.take());
            let read = read_tracks(subject, &description, options.mains_hz, observer)?;
            tracks = Some((&subject.name, read));
        }
        observer.fold_started(&fold.name(), number + 1, own.len());
        if let Some((_, tracks)) = &tracks {
            let outcome = fit::test_fold(tracks, fold, &description, options, observer)?;
            let outcome = outcome.with_settings(settings);
            outcome.write(&options.out)?;
            observer.fold_finished(&outcome);
        }
    }
    let mut outcomes = Vec::new();
    for (_, fold) in &plan {
        match outcome::read(&options.out, fold, &identity(options, fold))? {
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
pub fn merge(folders: &[PathBuf], out: &std::path::Path) -> Result<Table, TrainerError> {
    let table = Table::new(outcome::read_all(folders)?)?;
    outcome::prepare(out)?;
    for outcome in table.outcomes() {
        outcome.write(out)?;
    }
    table.write(out)?;
    Ok(table)
}

fn read_tracks(
    subject: &Subject,
    description: &Description,
    mains_hz: u32,
    observer: &mut impl CrossvalObserver,
) -> Result<Vec<Track>, TrainerError> {
    let mut tracks = Vec::new();
    for file in &subject.recordings {
        let track = Track::read(file, description, mains_hz)?;
        for warning in &track.warnings {
            observer.message(&format!("{}: warning: {warning}", track.name));
        }
        if !track.interpolated.is_empty() {
            let labels = track.interpolated.join(" ");
            observer.message(&format!("{}: interpolated: {labels}", track.name));
        }
        tracks.push(track);
    }
    Ok(tracks)
}

/// Returns everything that determines an outcome besides the fold's number, as text. Outcomes with different
/// texts are not in one table.
fn identity(options: &CrossvalOptions, fold: &Fold) -> String {
    let Shape {
        mode,
        numbers,
        steps,
        hop,
        padding,
        format,
    } = options.shape;
    let Settings {
        epochs,
        batch,
        peak_rate,
        seed,
    } = options.settings;
    format!(
        "montage {}, mode {mode}, {numbers} numbers, windows of {steps} steps, hop {hop}, padding {padding}, codes {format}, mains {} Hz; \
         {epochs} epochs in batches of {batch} at a learning rate of {peak_rate} with seed {seed}; {} folds of {} in {} \
         repetitions",
        options.montage.name,
        options.mains_hz,
        options.folds,
        fold.kind(),
        options.repetitions
    )
}
