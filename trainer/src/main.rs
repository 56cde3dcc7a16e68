//! The command line: `trainer train` and `trainer evaluate`.
#![forbid(unsafe_code)]

use clap::{Args, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use trainer::evaluate::Table;
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
    rate: f64,
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

/// Number of windows in a batch; each batch is one update of the parameters.
const BATCH: usize = 32;

fn main() -> ExitCode {
    let mut terminal = Terminal {
        bar: ProgressBar::hidden(),
    };
    let result = match Cli::parse().verb {
        Verb::Train(args) => session::train(&args.into(), &mut terminal),
        Verb::Evaluate(args) => {
            session::compare(&args.artifact, &args.data, &args.test, &mut terminal)
        }
    };
    match result {
        Ok(Comparison { network, pca }) => {
            print!("{}", Table(&[("autoencoder", network), ("PCA-128", pca)]));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("trainer: {error}");
            let mut cause = error.source();
            while let Some(error) = cause {
                eprintln!("  because {error}");
                cause = error.source();
            }
            ExitCode::FAILURE
        }
    }
}

impl From<TrainArgs> for TrainOptions {
    fn from(args: TrainArgs) -> Self {
        let TrainArgs {
            epochs,
            seed,
            rate: peak_rate,
            ..
        } = args;
        Self {
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
        }
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
