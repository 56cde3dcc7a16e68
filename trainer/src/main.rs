//! The command line: `trainer train`, `trainer evaluate` and `trainer montage check`.
#![forbid(unsafe_code)]

mod crossval_command;

use artifact::{Mode, MontageFile, Padding};
use clap::{Args, Parser, Subcommand, ValueEnum};
use crossval_command::{CrossvalArgs, MergeArgs};
use indicatif::{ProgressBar, ProgressStyle};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use trainer::card::Shape;
use trainer::error::TrainerError;
use trainer::evaluate::Table;
use trainer::montage_check::MontageCheck;
use trainer::recording_check::RecordingCheck;
use trainer::session::{self, Comparison, ProgressObserver, TrainOptions};
use trainer::training::{EpochReport, Settings};

/// Trains the convolutional autoencoder on EEG recordings and writes the artifact.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Train a model and write its artifact.
    Train(TrainArgs),
    /// Print the figures of an artifact, and of PCA with the same number of components.
    Evaluate(EvaluateArgs),
    /// Compare a model with PCA by cross-validation, for each subject.
    Crossval(CrossvalArgs),
    /// Make the table of a cross-validation from the folders of its shards.
    Merge(MergeArgs),
    /// Work with montage files, such as those in `montages/`.
    #[command(subcommand)]
    Montage(MontageVerb),
}

#[derive(Debug, Subcommand)]
enum MontageVerb {
    /// Print the grid of a montage and every mistake in it. Exit status: 0 no mistake, 2 mistakes.
    Check {
        /// Montage file.
        file: PathBuf,
        /// Recording (EDF, BDF, GDF) to compare: which electrodes it has, which are missing.
        #[arg(long)]
        recording: Option<PathBuf>,
    },
}

/// Layers of the network.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ModeArg {
    /// Linear maps only, fitted without epochs.
    Pca,
    /// The paper's network plus linear maps, which start as PCA.
    Shortcut,
    /// The paper's network; refused, because its codes cannot be decoded.
    Paper,
    /// The paper's network with nearest-neighbour unpooling.
    PaperCodeOnly,
}

/// Zero padding of both convolutions.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PaddingArg {
    /// No padding; needs a grid of at least 6 x 8 cells.
    None,
    /// One row and column on each side.
    Space,
    /// One row, column and step on each side.
    All,
}

/// Montage, and what can be chosen of a model.
#[derive(Args, Debug)]
struct ShapeArgs {
    /// Montage file: grid, order of the ADC's channels, ADC [default: montages/paper-61.toml].
    #[arg(long)]
    montage: Option<PathBuf>,
    /// Sampling rate of the ADC, Hz [default: that of the montage].
    #[arg(long, value_name = "HZ")]
    rate: Option<u32>,
    /// Layers of the network; pca takes no epochs.
    #[arg(long, value_enum, default_value = "shortcut")]
    mode: ModeArg,
    /// Length of a code: 8 to 256, a multiple of 4, at most steps times electrodes.
    #[arg(long, default_value_t = 128)]
    numbers: usize,
    /// Time steps from the start of one window to the next: 4, 8 or 16.
    #[arg(long, default_value_t = 8)]
    hop: usize,
    /// Time steps of a window: 16 or 32.
    #[arg(long, default_value_t = 16)]
    steps: usize,
    /// Zero padding of the convolutions.
    #[arg(long, value_enum, default_value = "none")]
    padding: PaddingArg,
}

impl ShapeArgs {
    /// Reads the montage file, or returns the paper's montage.
    fn montage(&self) -> Result<MontageFile, TrainerError> {
        let mut montage = match &self.montage {
            Some(path) => MontageFile::read(path)?,
            None => MontageFile::parse(Path::new("montages/paper-61.toml"), PAPER)?,
        };
        montage.adc.rate_hz = self.rate.unwrap_or(montage.adc.rate_hz);
        Ok(montage)
    }
}

impl From<&ShapeArgs> for Shape {
    fn from(args: &ShapeArgs) -> Self {
        Self {
            mode: match args.mode {
                ModeArg::Pca => Mode::Pca,
                ModeArg::Shortcut => Mode::Shortcut,
                ModeArg::Paper => Mode::Paper,
                ModeArg::PaperCodeOnly => Mode::PaperCodeOnly,
            },
            numbers: args.numbers,
            steps: args.steps,
            hop: args.hop,
            padding: match args.padding {
                PaddingArg::None => Padding::None,
                PaddingArg::Space => Padding::Space,
                PaddingArg::All => Padding::All,
            },
        }
    }
}

#[derive(Args, Debug)]
struct TrainArgs {
    /// Folder of the recordings (EDF, BDF, GDF).
    #[arg(long)]
    data: PathBuf,
    /// Recordings to train on: ends of file names, or ranges like R03..R10.
    #[arg(long, required = true, value_delimiter = ',')]
    train: Vec<String>,
    /// Recordings to test with; they are not used for training or validation.
    #[arg(long, required = true, value_delimiter = ',')]
    test: Vec<String>,
    #[command(flatten)]
    shape: ShapeArgs,
    /// Mains frequency of the recordings, Hz.
    #[arg(long, value_parser = clap::value_parser!(u32).range(45..=65))]
    mains: u32,
    /// Origin and licence of the recordings, for the training card.
    #[arg(long, default_value = "not stated")]
    dataset: String,
    /// References to cite, for the training card.
    #[arg(long, default_value = "not stated")]
    citation: String,
    /// Number of epochs.
    #[arg(long, default_value_t = 12)]
    epochs: u32,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Largest learning rate.
    #[arg(long, default_value_t = 1e-3)]
    learning_rate: f64,
    /// File that stores the training run after each epoch.
    #[arg(long, default_value = "target/trainer/checkpoint.safetensors")]
    checkpoint: PathBuf,
    /// Resume the training run from the checkpoint.
    #[arg(long)]
    resume: bool,
    /// Folder to write the artifact to.
    #[arg(long)]
    out: PathBuf,
    /// Replace an artifact in this folder.
    #[arg(long)]
    force: bool,
}

#[derive(Args, Debug)]
struct EvaluateArgs {
    /// Folder to read the artifact from.
    #[arg(long)]
    artifact: PathBuf,
    /// Folder of the recordings, including the training files, to which PCA is fitted.
    #[arg(long)]
    data: PathBuf,
    /// Recordings to test with [default: those in the training card].
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
}

/// The default montage.
const PAPER: &str = include_str!("../../montages/paper-61.toml");
/// Number of windows in a batch; each batch is one update of the parameters.
const BATCH: usize = 32;

fn main() -> ExitCode {
    let mut terminal = Terminal {
        bar: ProgressBar::hidden(),
    };
    let result = match Cli::parse().verb {
        Verb::Crossval(args) => return exit_status(args.run()),
        Verb::Merge(args) => return exit_status(args.run()),
        Verb::Montage(MontageVerb::Check { file, recording }) => {
            return check_montage(&file, recording.as_deref());
        }
        Verb::Train(args) => match args.into_options() {
            Ok(options) => session::train(&options, &mut terminal),
            Err(error) => Err(error),
        },
        Verb::Evaluate(args) => {
            session::compare(&args.artifact, &args.data, &args.test, &mut terminal)
        }
    };
    match result {
        Ok(Comparison {
            network,
            pca,
            numbers,
            is_pca,
        }) => {
            let name = format!("PCA-{numbers}");
            let rows = [("autoencoder", network), (name.as_str(), pca)];
            print!("{}", Table(&rows[usize::from(is_pca)..]));
            ExitCode::SUCCESS
        }
        Err(error) => exit_status(Err(error)),
    }
}

/// Prints an error; returns the exit status.
fn exit_status(result: Result<(), TrainerError>) -> ExitCode {
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    print_error(&error);
    // Settings and montages that no model can have are wrong usage.
    match error {
        TrainerError::MontageFile(_)
        | TrainerError::MontageMistakes { .. }
        | TrainerError::TooManyNumbers { .. }
        | TrainerError::TooFewBlocks { .. }
        | TrainerError::PaperMode
        | TrainerError::Shape(_) => ExitCode::from(2),
        _ => ExitCode::FAILURE,
    }
}

/// Prints an error with its causes to standard error.
fn print_error(error: &dyn Error) {
    eprintln!("trainer: {error}");
    let mut cause = error.source();
    while let Some(error) = cause {
        eprintln!("  because {error}");
        cause = error.source();
    }
}

/// Prints the check of a montage, and how a recording fits it; returns the exit status.
fn check_montage(file: &Path, recording: Option<&Path>) -> ExitCode {
    let montage = match MontageFile::read(file) {
        Ok(montage) => montage,
        Err(error) => {
            print_error(&error);
            return ExitCode::from(2);
        }
    };
    let check = MontageCheck::new(&montage);
    print!("{check}");
    if !check.mistakes.is_empty() {
        return ExitCode::from(2);
    }
    let Some(recording) = recording else {
        return ExitCode::SUCCESS;
    };
    match RecordingCheck::read(recording, &montage) {
        Ok(check) => {
            print!("{check}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            print_error(&error);
            ExitCode::from(2)
        }
    }
}

impl TrainArgs {
    fn into_options(self) -> Result<TrainOptions, TrainerError> {
        let args = self;
        let TrainArgs {
            epochs,
            seed,
            learning_rate: peak_rate,
            ..
        } = args;
        Ok(TrainOptions {
            montage: args.shape.montage()?,
            shape: Shape::from(&args.shape),
            data: args.data,
            train: args.train,
            test: args.test,
            mains_hz: args.mains,
            dataset: args.dataset,
            citation: args.citation,
            settings: Settings {
                epochs,
                batch: BATCH,
                peak_rate,
                seed,
            },
            checkpoint: args.checkpoint,
            resume: args.resume,
            out: args.out,
            force: args.force,
        })
    }
}

/// Prints progress to standard error: lines and a progress bar.
struct Terminal {
    bar: ProgressBar,
}

impl ProgressObserver for Terminal {
    fn message(&mut self, text: &str) {
        eprintln!("{text}");
    }

    fn epoch_started(&mut self, epoch: u32, epochs: u32, batches: usize) {
        let style = "epoch {prefix} {bar:30} {pos}/{len} batches, {eta} left, loss {msg}";
        let style = ProgressStyle::with_template(style).expect("a template with known keys");
        self.bar = ProgressBar::new(batches as u64).with_style(style);
        self.bar.set_prefix(format!("{epoch}/{epochs}"));
    }

    fn batch_finished(&mut self, batches: usize, loss: f64) {
        self.bar.set_position(batches as u64);
        self.bar.set_message(format!("{loss:.5}"));
    }

    fn epoch_finished(&mut self, report: EpochReport) {
        let EpochReport {
            epoch,
            loss,
            validation,
        } = report;
        self.bar.finish_and_clear();
        eprintln!("epoch {epoch}: training loss {loss:.5}, validation MSE {validation:.5}");
    }
}
