//! Cross-validation: the test error of a model and of PCA, for each subject, over folds of whole
//! runs or of contiguous blocks.
//!
//! ```text
//! recordings --group--> Subject --deal--> Fold --fit, test--> Outcome, one file each
//!                                          |                        |
//!                                     shard K of N              Table as Markdown, CSV, JSON
//! ```
//!
//! Each fold is tested with a model trained on the other folds of the same subject or, with
//! `--leave-one-person-out`, each subject with a model trained on all other subjects. Bad
//! electrodes are interpolated ([`People`]). No window of a test fold overlaps a training window:
//! folds consist of whole runs, or of blocks with a gap of one window between them, never of
//! shuffled windows.
//!
//! Every outcome is a file of its own. So an interrupted cross-validation continues with the
//! missing folds, and several processes or machines can share the folds ([`Shard`]) and one folder.
//! The table depends on the outcomes alone.

mod fit;
mod outcome;
mod plan;
mod table;

use crate::card::{ModelOptions, description_to_compare};
use crate::error::TrainerError;
use crate::people::People;
use crate::people::read_tracks;
use crate::progress::ProgressObserver;
use crate::selection::{self, mains_hz};
use crate::subject::group;
use crate::training::Settings;
use clap::Args;
use std::path::PathBuf;

use fit::Data;
pub(crate) use outcome::Outcome;
use plan::{Fold, Shard};
pub(crate) use table::Table;
pub(crate) use table::columns;

/// Options of `trainer crossval`.
#[derive(Args, Clone, Debug)]
pub(crate) struct CrossvalOptions {
    /// Folder in which recordings are looked up by name.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings (EDF, BDF, GDF) of all subjects: files, folders, patterns such as 'S001*.edf',
    /// ends of the names of files in --data, or ranges of them like R03..R12 [default: all in
    /// --data].
    #[arg(long, value_delimiter = ',')]
    recordings: Vec<String>,
    /// Name of the subject in all recordings [default: the text before the run's number in each
    /// file name].
    #[arg(long)]
    subject: Option<String>,
    #[command(flatten)]
    model: ModelOptions,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long = "mains", value_name = "MAINS", value_parser = mains_hz)]
    mains_hz: u32,
    #[command(flatten)]
    settings: Settings,
    /// Test each subject once, on all recordings, with a model trained on all other subjects.
    #[arg(long, conflicts_with_all = ["folds", "repetitions", "blocks", "subject"])]
    leave_one_person_out: bool,
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
    /// Compute only shard K of N of the folds. Shards can share the folder of --out.
    #[arg(long, value_name = "K/N", default_value = "1/1")]
    shard: Shard,
    /// Folder of the outcomes and of the table. Folds whose outcome is there are not computed
    /// again.
    #[arg(long)]
    pub(crate) out: PathBuf,
}

/// Computes the folds of the shard whose outcomes are missing, and writes each outcome. Returns the
/// table if the outcomes of all shards exist, otherwise `None`.
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
    let subjects = group(&recordings, options.subject.as_deref());
    let names: Vec<&str> = subjects.iter().map(|s| s.name.as_str()).collect();
    let identity = |fold: &Fold| identity(options, &montage.name, &names.join(" "), fold);
    outcome::prepare(&options.out)?;
    let plan = plan::plan(&subjects, options)?;
    let mut missing = Vec::new();
    for (index, fold) in plan.iter().enumerate() {
        if !options.shard.contains(index) {
            continue;
        }
        if outcome::read(&options.out, fold, &identity(fold))?.is_some() {
            observer.message(&format!("{}: done before", fold.name()));
        } else {
            missing.push(fold);
        }
    }
    observer.folds_planned(missing.iter().map(|fold| fold.trained_on).sum());
    let mut loaded: Option<(&str, People)> = None;
    for (number, fold) in missing.iter().enumerate() {
        // Keep only one subject's recordings in memory, unless models are trained on other people.
        let (name, files) = if options.leave_one_person_out {
            ("", &recordings)
        } else {
            let mut subjects = subjects.iter();
            let own = subjects.find(|subject| subject.name == fold.subject);
            let own = own.expect("the plan's folds are those of the subjects");
            (own.name.as_str(), &own.recordings)
        };
        let people = if let Some((_, people)) = loaded.take().filter(|(loaded, _)| *loaded == name)
        {
            people
        } else {
            let tracks = read_tracks(files, &description, options.mains_hz, observer)?;
            let electrodes = &description.montage.electrodes;
            let subject = Some(name).filter(|name| !name.is_empty());
            People::new(tracks, electrodes, subject, observer)?
        };
        observer.fold_started(&fold.name(), number + 1, missing.len());
        let data = if options.leave_one_person_out {
            let (others, test) = people.leave_out(&fold.subject);
            Data { training: others.at_equal_power(observer), recorded: others.tracks, test }
        } else {
            Data::of_fold(&people.tracks, fold, description.window.steps)
        };
        let mut outcome = fit::test_fold(&data, fold, &description, options.settings, observer)?;
        outcome.settings = identity(fold);
        outcome.write(&options.out)?;
        observer.fold_finished(&outcome, fold.trained_on);
        loaded = Some((name, people));
    }
    let mut outcomes = Vec::new();
    for fold in &plan {
        match outcome::read(&options.out, fold, &identity(fold))? {
            Some(outcome) => outcomes.push(outcome),
            None => return Ok(None),
        }
    }
    let table = Table::new(outcomes);
    table.write(&options.out)?;
    Ok(Some(table))
}

/// Returns all settings that determine an outcome, except the fold number, as text. All outcomes of
/// a subject in a table have the same text.
fn identity(options: &CrossvalOptions, montage: &str, people: &str, fold: &Fold) -> String {
    let test = if options.leave_one_person_out {
        format!("each of {people} with a model of the others")
    } else {
        format!("{} folds of {} in {} repetitions", options.folds, fold.kind(), options.repetitions)
    };
    format!(
        "montage {montage}, {}, codes {}, mains {} Hz; {} epochs in {}; {test}",
        options.model.shape,
        options.model.shape.format,
        options.mains_hz,
        options.settings.epochs,
        options.settings,
    )
}
