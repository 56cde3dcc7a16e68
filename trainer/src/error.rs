//! Errors of training and evaluation.

use std::path::PathBuf;

/// An error that stops training or evaluation.
#[derive(Debug, thiserror::Error)]
pub enum TrainerError {
    /// The artifact has a packed model already.
    #[error("{} has a packed model already; --force replaces it", folder.display())]
    PackedExists {
        /// Folder of the artifact.
        folder: PathBuf,
    },
    /// A block cannot have this number of coefficients.
    #[error(
        "a block cannot have {count} coefficients: they are a multiple of 16, and at most {most} with this montage and \
         hop"
    )]
    Coefficients {
        /// The wanted number.
        count: usize,
        /// Largest number; 0 if the block has fewer than 16 values.
        most: usize,
    },
    /// The artifact has no packed model.
    #[error("{} has no packed model; `trainer packed` trains one", folder.display())]
    NotPacked {
        /// Folder of the artifact.
        folder: PathBuf,
    },
    /// No rate reaches the wanted error.
    #[error(
        "no rate has a mean squared error of {target} or less; the finest reaches {least:.5}: ask for more, or train \
         with more --coefficients"
    )]
    TargetOutOfReach {
        /// The wanted mean squared error.
        target: f64,
        /// That of the finest rate.
        least: f64,
    },
    /// A file or folder cannot be read or written.
    #[error("cannot access {}", path.display())]
    File {
        /// File or folder that was accessed.
        path: PathBuf,
        /// Error from the operating system.
        source: std::io::Error,
    },
    /// The folder to write to holds an artifact.
    #[error("{} holds an artifact already; choose another folder, or replace it with --force", folder.display())]
    ArtifactExists {
        /// Folder of the artifact.
        folder: PathBuf,
    },
    /// A name on the command line matches no recording.
    #[error(
        "no recording in {} ends with {name}; {}",
        folder.display(),
        match found.as_slice() {
            [] => "the folder has none: name the folder of the recordings with --data".to_owned(),
            found => format!("the folder has: {}", found.join(" ")),
        }
    )]
    NothingFound {
        /// Name on the command line.
        name: String,
        /// Folder that was searched.
        folder: PathBuf,
        /// File names of the recordings in the folder.
        found: Vec<String>,
    },
    /// A folder has no recording.
    #[error("{} has no recording; recordings end with .edf, .bdf or .gdf", folder.display())]
    EmptyFolder {
        /// The folder.
        folder: PathBuf,
    },
    /// A pattern on the command line matches no recording.
    #[error("no recording matches {pattern}; recordings end with .edf, .bdf or .gdf")]
    NothingMatches {
        /// The pattern.
        pattern: String,
    },
    /// A pattern on the command line is malformed.
    #[error("{pattern} is no pattern of paths")]
    BadPattern {
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        source: glob::PatternError,
    },
    /// A range of names on the command line cannot be expanded, such as R10..R03.
    #[error("{range} is not a range of names; write for example R03..R10")]
    BadRange {
        /// Range on the command line.
        range: String,
    },
    /// A recording is both a training and a test file.
    #[error(
        "{name} is both a training and a test file, so its figures would be meaningless; remove it from one of them"
    )]
    TrainedOn {
        /// File name of the recording.
        name: String,
    },
    /// A recording is damaged or in an unsupported format.
    #[error("cannot read the recording {name}")]
    Recording {
        /// File name of the recording.
        name: String,
        /// Why the recording could not be read.
        source: recordings::RecordingError,
    },
    /// The electrode labels of a recording do not fit the montage.
    #[error("the recording {name} does not fit the montage")]
    Montage {
        /// File name of the recording.
        name: String,
        /// Error from the `recordings` crate, which names the labels.
        source: recordings::MontageMapError,
    },
    /// A recording is too short: too few time steps remain after the filters have settled.
    #[error(
        "{name} has {steps} time steps after the filters have settled; at least {needed} are needed"
    )]
    TooShort {
        /// File name of the recording.
        name: String,
        /// Number of time steps after the filters have settled.
        steps: usize,
        /// Minimum number of time steps.
        needed: usize,
    },
    /// All samples of the recordings are 0 after filtering.
    #[error(
        "the training recordings are 0 in all electrodes; check the physical unit in the files"
    )]
    Silent,
    /// The filters of the description cannot be realised.
    #[error("the filters for {mains_hz} Hz mains cannot be realised")]
    Filter {
        /// Mains frequency of the filters, Hz.
        mains_hz: u32,
        /// Error from the filter design.
        source: model_gen::FilterError,
    },
    /// The resampler of the description cannot be realised.
    #[error("the decimation cannot be realised")]
    Resampler(#[source] model_gen::FilterError),
    /// A montage file cannot be read.
    #[error("the montage cannot be used")]
    MontageFile(#[from] artifact::MontageFileError),
    /// A montage has mistakes.
    #[error(
        "the montage {name} has {} mistake(s):\n  {}\n`trainer montage check` prints the grid with them",
        mistakes.len(),
        mistakes.join("\n  ")
    )]
    MontageMistakes {
        /// Name of the montage.
        name: String,
        /// All mistakes, in words.
        mistakes: Vec<String>,
    },
    /// A code has more numbers than a window has values.
    #[error(
        "--numbers {numbers} is more than the {values} values of a window ({steps} steps of {electrodes} electrodes); use at most {values}, or more --steps"
    )]
    TooManyNumbers {
        /// Requested length of the code.
        numbers: usize,
        /// Number of values in a window.
        values: usize,
        /// Number of time steps in a window.
        steps: usize,
        /// Number of electrodes.
        electrodes: usize,
    },
    /// No model can have the requested shape.
    #[error("no model can have this shape; see `trainer train --help`")]
    Shape(#[source] artifact::ArtifactError),
    /// A model of mode `paper` cannot be evaluated, because its codes cannot be decoded.
    #[error(
        "--mode paper is not trained here: its decoder needs pool indices that are not sent; use paper-code-only or shortcut"
    )]
    PaperMode,
    /// The artifact cannot be read, created or written.
    #[error(transparent)]
    Artifact(#[from] artifact::ArtifactError),
    /// A range or factor of the model does not fit its integer format.
    #[error("the model cannot be turned into integers")]
    Quantise(#[from] model_gen::ModelGenError),
    /// A file is not a checkpoint or is damaged.
    #[error("{} is not a checkpoint of this trainer or is damaged: {problem}; train without --resume", path.display())]
    Checkpoint {
        /// Path of the checkpoint.
        path: PathBuf,
        /// Description of the damage.
        problem: String,
    },
    /// A checkpoint was written with other settings or data.
    #[error("{} belongs to a training with {found}, this one has {expected}; use the same settings, or train without --resume", path.display())]
    OtherTraining {
        /// Path of the checkpoint.
        path: PathBuf,
        /// Settings and data in the checkpoint.
        found: String,
        /// Settings and data of this training run.
        expected: String,
    },
    /// The loss is infinite or NaN.
    #[error("the loss of epoch {epoch} is {loss}: training diverged; use a lower --learning-rate")]
    Diverged {
        /// Number of the epoch that diverged, from 1.
        epoch: u32,
        /// Loss of the last batch.
        loss: f64,
    },
    /// A subject has fewer runs or blocks than folds.
    #[error(
        "{subject} has {blocks} runs or blocks for {folds} folds; at least 2 folds, and a block for each, are needed: \
         use more recordings, fewer --folds, or more --blocks"
    )]
    TooFewBlocks {
        /// Name of the subject.
        subject: String,
        /// Number of runs or blocks.
        blocks: usize,
        /// Number of folds.
        folds: usize,
    },
    /// A folder has an outcome of another cross-validation.
    #[error(
        "{} belongs to another cross-validation; choose another folder for --out\n  it has:   {found}\n  expected: {expected}",
        path.display()
    )]
    OtherCrossval {
        /// File of the outcome.
        path: PathBuf,
        /// Settings in the file.
        found: String,
        /// Settings on the command line.
        expected: String,
    },
    /// An outcome cannot be read.
    #[error("{} is no outcome of a fold; delete it, and its fold is computed again", path.display())]
    Outcome {
        /// File of the outcome.
        path: PathBuf,
        /// Error from the parser.
        source: serde_json::Error,
    },
    /// Two folders have different outcomes of the same fold.
    #[error(
        "fold {fold} has another outcome in {} than in a folder before it; merge shards of one cross-validation",
        path.display()
    )]
    TwoOutcomes {
        /// Name of the fold.
        fold: String,
        /// File of the second outcome.
        path: PathBuf,
    },
    /// No folder has an outcome.
    #[error("there are no outcomes to merge; name the folders that `trainer crossval --out` wrote")]
    NoOutcomes,
    /// Outcomes of different cross-validations.
    #[error(
        "fold {other} does not belong to the same cross-validation as {first}\n  {first}: {of_first}\n  {other}: {of_other}"
    )]
    MixedOutcomes {
        /// Name of the first fold.
        first: String,
        /// Its settings.
        of_first: String,
        /// Name of the other fold.
        other: String,
        /// Its settings.
        of_other: String,
    },
    /// Folds without an outcome.
    #[error("folds are missing: {}; compute them with `trainer crossval`, or name the folders of all shards", missing.join(" "))]
    MissingOutcomes {
        /// Names of the folds.
        missing: Vec<String>,
    },
    /// A folder to write to cannot be written.
    #[error("{} cannot be written; name another folder", folder.display())]
    NotWritable {
        /// The folder.
        folder: PathBuf,
        /// Error from the operating system.
        source: std::io::Error,
    },
    /// A checkpoint has another number of epochs, and is not finished or has more.
    #[error(
        "{} has finished {finished} of {stored} epochs; resume it with --epochs {stored}, then more epochs can be \
         added ({wanted} were asked for)",
        path.display()
    )]
    OtherEpochs {
        /// File of the checkpoint.
        path: PathBuf,
        /// Number of epochs that the training run was started with.
        stored: u32,
        /// Number of finished epochs.
        finished: u32,
        /// Number of epochs on the command line.
        wanted: u32,
    },
    /// The folder of a report holds one already.
    #[error(transparent)]
    Report(#[from] new_file::NewFileError),
    /// A picture of a report cannot be written.
    #[error(transparent)]
    Picture(#[from] picture::canvas::PictureError),
    /// A training run without epochs and without test recordings has nothing to report.
    #[error(
        "mode pca has no epochs, and there are no test recordings, so --report has nothing to show; add --test, or \
         leave out --report"
    )]
    NothingToReport,
    /// No test recordings are named, on the command line or in the training card.
    #[error("the training card names no test recordings; name recordings with --test")]
    NothingToTest,
    /// The system does not report Ctrl-C.
    #[error("the program cannot listen for Ctrl-C")]
    Signals(#[source] std::io::Error),
    /// The user interrupted the training.
    #[error("interrupted after {epochs} epochs; {}", resume_words(*epochs, checkpoint))]
    Interrupted {
        /// Number of finished epochs.
        epochs: u32,
        /// File of the checkpoint.
        checkpoint: PathBuf,
    },
}

/// Returns how an interrupted training run goes on.
fn resume_words(epochs: u32, checkpoint: &std::path::Path) -> String {
    if epochs == 0 {
        return "there is no checkpoint yet".to_owned();
    }
    format!(
        "{} is the checkpoint, and the same command with --resume goes on",
        checkpoint.display()
    )
}
