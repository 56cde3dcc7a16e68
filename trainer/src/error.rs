//! Why training or evaluation stops.

use std::path::PathBuf;

/// Why training or evaluation stops.
#[derive(Debug, thiserror::Error)]
pub enum TrainerError {
    /// A file or folder cannot be read or written.
    #[error("cannot access {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A name picks no recording.
    #[error("no recording in {} ends with {name}; there are: {}", folder.display(), found.join(" "))]
    NothingFound {
        /// The name.
        name: String,
        /// Where it was looked for.
        folder: PathBuf,
        /// Names of the recordings that are there.
        found: Vec<String>,
    },
    /// A range of names that cannot be counted through.
    #[error("{range} is no range of names; write for example R03..R10")]
    BadRange {
        /// The range.
        range: String,
    },
    /// A recording is both trained on and tested with.
    #[error("{name} is among the training and the test files; its figures would mean nothing")]
    TrainedOn {
        /// The file's name.
        name: String,
    },
    /// A recording cannot be read.
    #[error("cannot read the recording {name}")]
    Recording {
        /// The file's name.
        name: String,
        /// What the reader said.
        source: recordings::RecordingError,
    },
    /// A recording does not fit the montage.
    #[error("the recording {name} does not fit the montage")]
    Montage {
        /// The file's name.
        name: String,
        /// What does not fit.
        source: recordings::MontageMapError,
    },
    /// A recording is too short for a window behind the filters' settling.
    #[error(
        "{name} gives {steps} time steps behind the filters' settling; at least {needed} are needed"
    )]
    TooShort {
        /// The file's name.
        name: String,
        /// Time steps that remain.
        steps: usize,
        /// Time steps that would be enough.
        needed: usize,
    },
    /// The recordings hold nothing but silence.
    #[error("the training recordings are silent in all electrodes; are they of the right unit?")]
    Silent,
    /// The filters of the description cannot be realised.
    #[error("the filters for {mains_hz} Hz mains cannot be realised")]
    Filter {
        /// The mains frequency.
        mains_hz: u32,
        /// What does not work.
        source: model_gen::FilterError,
    },
    /// The ADC's rate cannot be brought to that of the steps.
    #[error("the decimation cannot be realised")]
    Resampler(#[source] model_gen::FilterError),
    /// The filters have another number of sections than the trainer plays.
    #[error(
        "the filters have {found} sections, but the trainer plays 6: write harmonics = 0 and order = 5 under [filters] of model.toml"
    )]
    Sections {
        /// Sections of the description's filters.
        found: usize,
    },
    /// The artifact cannot be read, made or written.
    #[error(transparent)]
    Artifact(#[from] artifact::ArtifactError),
    /// The model cannot be turned into integers.
    #[error("the model cannot be turned into integers")]
    Quantise(#[from] model_gen::ModelGenError),
    /// A checkpoint is no checkpoint or is damaged.
    #[error("{} is no checkpoint of this trainer or is damaged: {problem}; train without --resume", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A checkpoint belongs to another training.
    #[error("{} is of a training with {found}, this one has {expected}; use the same settings, or train without --resume", path.display())]
    OtherTraining {
        /// The file.
        path: PathBuf,
        /// The setting in the checkpoint.
        found: String,
        /// The setting of this run.
        expected: String,
    },
    /// The loss is no number any more.
    #[error("the loss of epoch {epoch} is {loss}: training diverged; use a lower --rate")]
    Diverged {
        /// The epoch.
        epoch: u32,
        /// Its loss.
        loss: f64,
    },
}
