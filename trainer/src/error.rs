//! Errors of training, evaluation, checks and import.

use packed_fit::FitError;
use std::io;
use std::path::{Path, PathBuf};

/// An error that ends a command.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum TrainerError {
    // Usage errors, which the user can correct on the command line.
    /// The model already has the part that the text names.
    #[error("{} has a {} already; --force replaces it", .0.display(), .1)]
    PartExists(PathBuf, &'static str),
    #[error(
        "no rate has a mean squared error of {target} or less; the finest reaches {least:.5}: ask \
         for more, or train with more --coefficients"
    )]
    TargetOutOfReach { target: f64, least: f64 },
    #[error("{} holds a model already; choose another folder, or replace it with --force", .0.display())]
    ArtifactExists(PathBuf),
    /// A name matches no recording in a folder; `found` lists the folder's recordings.
    #[error("no recording in {} ends with {name}; {}", folder.display(), found_words(found))]
    NothingFound { name: String, folder: PathBuf, found: Vec<String> },
    #[error("{} has no recording; recordings end with .edf, .bdf or .gdf", .0.display())]
    EmptyFolder(PathBuf),
    #[error("no recording matches {0}; recordings end with .edf, .bdf or .gdf")]
    NothingMatches(String),
    #[error("{0} is no pattern of paths")]
    BadPattern(String, #[source] glob::PatternError),
    #[error("{0} is not a range of names; write for example R03..R10")]
    BadRange(String),
    #[error(
        "{0} is both a training and a test file, so its figures would be meaningless; remove it \
         from one of them"
    )]
    TrainedOn(String),
    #[error("the montage cannot be used")]
    MontageFile(#[from] artifact::MontageFileError),
    #[error(
        "the montage {name} has {} mistake(s):\n  {}\n\
         `trainer montage check` prints the grid with them",
        mistakes.len(),
        mistakes.join("\n  ")
    )]
    MontageMistakes { name: String, mistakes: Vec<String> },
    /// A code has more numbers than a window has values.
    #[error(
        "--numbers {numbers} is more than the {} values of a window ({steps} steps of {electrodes} \
         electrodes); use at most {}, or more --steps",
        steps * electrodes,
        steps * electrodes
    )]
    TooManyNumbers { numbers: usize, steps: usize, electrodes: usize },
    #[error("no model can have this shape; see `trainer train --help`")]
    Shape(#[source] artifact::ArtifactError),
    #[error(
        "--mode paper is not trained here: its decoder needs pool indices that are not sent; use \
         paper-code-only or shortcut"
    )]
    PaperMode,
    /// A checkpoint was written with other settings or data. The texts describe the settings and
    /// data of the checkpoint, and the expected settings and data.
    #[error(
        "{} belongs to a training with {}, this one has {}; use the same settings, or train without \
         --resume",
        .0.display(), .1, .2
    )]
    OtherTraining(PathBuf, String, String),
    /// A checkpoint cannot be resumed with the requested number of epochs: the number is smaller
    /// than the checkpoint's, or larger while the checkpoint's training run is not finished.
    #[error(
        "{} has finished {finished} of {stored} epochs; resume it with --epochs {stored}, then \
         more epochs can be added ({requested} were asked for)",
        path.display()
    )]
    OtherEpochs { path: PathBuf, stored: u32, finished: u32, requested: u32 },
    /// A subject has fewer runs or blocks than folds.
    #[error(
        "{subject} has {blocks} runs or blocks for {folds} folds; at least 2 folds, and a block \
         for each, are needed: use more recordings, fewer --folds, or more --blocks"
    )]
    TooFewBlocks { subject: String, blocks: usize, folds: usize },
    #[error(
        "all recordings are of one person, {0}, so there are no others to train on; name recordings of \
         several people, whose names precede the run: S001R03.edf is of S001"
    )]
    OnePerson(String),
    /// A folder contains an outcome of another cross-validation. The texts are the outcome's
    /// settings and the expected settings.
    #[error(
        "{} belongs to another cross-validation; choose another folder for --out\n  \
         it has:   {}\n  expected: {}",
        .0.display(), .1, .2
    )]
    OtherCrossval(PathBuf, String, String),
    #[error(transparent)]
    Report(#[from] new_file::NewFileError),
    /// A training run without epochs and without test recordings has nothing to report.
    #[error(
        "mode pca has no epochs, and there are no test recordings, so --report has nothing to \
         show; add --test, or leave out --report"
    )]
    NothingToReport,
    #[error("the training card names no test recordings; name recordings with --test")]
    NothingToTest,

    #[error("--events needs two or more classes, each with another event and another code")]
    Classes,
    #[error(
        "{filters} filters cannot be divided among {classes} classes; --filters takes a multiple of \
         {classes}, at most 8"
    )]
    Filters { filters: usize, classes: usize },
    #[error(
        "--window {window_s} is not between one hop and the {trial_s} s of --trial, of which a \
         decision is made"
    )]
    DecisionWindow { window_s: f64, trial_s: f64 },
    /// No recording that the option `files` names has this event. `found` lists the events in these
    /// recordings, each with its count.
    #[error("no recording of {files} has the event {event}; {}", event_words(found))]
    NoSuchEvent { files: &'static str, event: String, found: Vec<(String, usize)> },

    // Errors of recordings and other files.
    #[error(
        "the training recordings have {count} whole trials of {event}; at least {needed} are \
         needed: use more recordings, or a shorter --trial"
    )]
    TooFewTrials { event: String, count: u32, needed: usize },
    #[error(
        "nearly all trials of {0} are in one recording, so that it cannot be left out for the \
         cross-validation; use recordings with trials of every class"
    )]
    UnevenTrials(String),
    #[error("no device could run this classifier")]
    Classifier(#[from] artifact::classifier::ClassifierError),
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error("cannot access {}", .0.display())]
    File(PathBuf, #[source] io::Error),
    #[error("{} cannot be written; name another folder", .0.display())]
    NotWritable(PathBuf, #[source] io::Error),
    #[error(
        "{name} has {steps} time steps after the filters have settled; at least {needed} are needed"
    )]
    TooShort { name: String, steps: usize, needed: usize },
    #[error(
        "the training recordings have {seconds} s after the filters have settled, which do not \
         determine how {electrodes} electrodes depend on each other; train on at least {electrodes} s, \
         better on some minutes"
    )]
    TooFewSeconds { seconds: usize, electrodes: usize },
    /// The sweeps that substitute these electrodes do not converge.
    #[error(
        "the substitution of {} does not converge (spectral radius {radius:.3}, must be below 1): \
         weights of 8 bits do not represent these electrodes; check whether they are bridged or of \
         very different size, or train on other recordings",
        labels.join(" ")
    )]
    NoConvergence { labels: Vec<String>, radius: f64 },
    #[error("{} holds no usable model", .0.display())]
    NoModel(PathBuf, #[source] Box<artifact::ArtifactError>),
    #[error(transparent)]
    Artifact(#[from] artifact::ArtifactError),
    #[error("{} is damaged, or the checkpoint of another version of the trainer: {}; train without --resume", .0.display(), .1)]
    Checkpoint(PathBuf, String),
    #[error(transparent)]
    Picture(#[from] picture::canvas::PictureError),

    // Errors of a cross-validation's outcomes.
    #[error("{} is no outcome of a fold; delete it, and its fold is computed again", .0.display())]
    Outcome(PathBuf, #[source] serde_json::Error),
    // Errors of the model.
    #[error("the model cannot be turned into integers")]
    Quantise(#[from] model_gen::ModelGenError),
    #[error("the {1} of epoch {0} is {2}: training diverged; use a lower --learning-rate")]
    Diverged(u32, &'static str, f64),

    // Errors of an import.
    #[error("{} is no specification of an import; docs/importing.md has an example", .0.display())]
    Spec(PathBuf, #[source] Box<toml::de::Error>),
    #[error("{} describes no possible model", .0.display())]
    Described(PathBuf, #[source] Box<TrainerError>),
    #[error(
        "{} is damaged or no safetensors file; export it again, with `safetensors.torch.save_file`",
        .0.display()
    )]
    Safetensors(PathBuf, #[source] safetensors::SafeTensorError),
    #[error("the tensors of {} are no usable model", .0.display())]
    Unusable(PathBuf, #[source] Box<TrainerError>),
    #[error("{} and {} do not fit together:\n  {}", .0.display(), .1.display(), .2.join("\n  "))]
    ImportMistakes(PathBuf, PathBuf, Vec<String>),
    /// With the same weights, this program computes other values than the exported network did.
    /// `what` is `code` or `reconstruction`; `difference` is the largest difference, and `rms` the
    /// RMS of all reference values.
    #[error(
        "{what} {index} of the reference differs by {difference:.3e} in element {element}, more \
         than {tolerance:.0e} of the RMS of all {what}s ({rms:.3e}): the exported network is not \
         the one that the specification describes (order of layers, padding, pool, training mode \
         instead of `eval()`), or the reference is of other weights"
    )]
    Reference {
        what: &'static str,
        index: usize,
        element: usize,
        difference: f32,
        rms: f32,
        tolerance: f32,
    },

    // Errors that concern Ctrl-C.
    #[error("the program cannot listen for Ctrl-C")]
    Signals(#[source] io::Error),
    #[error("interrupted after {} epochs; {}", .0, resume_words(*.0, .1))]
    Interrupted(u32, PathBuf),
}

impl TrainerError {
    /// Returns whether the user can correct the error on the command line: settings that no model
    /// can have, names that match nothing, or files that would be replaced.
    pub fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::PartExists(..)
                | Self::Fit(FitError::Coefficients { .. })
                | Self::TargetOutOfReach { .. }
                | Self::ArtifactExists(_)
                | Self::NothingFound { .. }
                | Self::EmptyFolder(_)
                | Self::NothingMatches(_)
                | Self::BadPattern(..)
                | Self::BadRange(_)
                | Self::TrainedOn(_)
                | Self::MontageFile(_)
                | Self::MontageMistakes { .. }
                | Self::TooManyNumbers { .. }
                | Self::Shape(_)
                | Self::PaperMode
                | Self::OtherTraining(..)
                | Self::OtherEpochs { .. }
                | Self::TooFewBlocks { .. }
                | Self::OnePerson(_)
                | Self::OtherCrossval(..)
                | Self::Report(_)
                | Self::NothingToReport
                | Self::NothingToTest
                | Self::Classes
                | Self::Filters { .. }
                | Self::DecisionWindow { .. }
                | Self::NoSuchEvent { .. }
        )
    }

    /// Returns a function that adds the name of the file `path` to an error of the operating
    /// system.
    pub(crate) fn file(path: &Path) -> impl Fn(io::Error) -> Self + Copy + '_ {
        |source| Self::File(path.to_owned(), source)
    }

    /// Returns a function that adds the name of a model's folder to an error in reading the model.
    pub(crate) fn no_model(folder: &Path) -> impl Fn(artifact::ArtifactError) -> Self + Copy + '_ {
        |source| Self::NoModel(folder.to_owned(), Box::new(source))
    }
}

/// Returns the part of an error message that lists the events in recordings.
fn event_words(found: &[(String, usize)]) -> String {
    if found.is_empty() {
        return "they have no events within their signals".to_owned();
    }
    let events = found.iter().map(|(event, count)| format!("{event} ({count} times)"));
    format!("they have: {}", events.collect::<Vec<_>>().join(", "))
}

/// Returns the part of an error message that lists the recordings in a folder.
fn found_words(found: &[String]) -> String {
    match found {
        [] => "the folder has none: name the folder of the recordings with --data".to_owned(),
        found => format!("the folder has: {}", found.join(" ")),
    }
}

/// Returns the part of an error message that states how to resume an interrupted training run.
fn resume_words(epochs: u32, checkpoint: &Path) -> String {
    if epochs == 0 {
        return "there is no checkpoint yet".to_owned();
    }
    let checkpoint = checkpoint.display();
    format!("{checkpoint} is the checkpoint, and the same command with --resume goes on")
}
