//! `trainer train`.

use clap::Args;
use std::path::PathBuf;
use trainer::card::Shape;
use trainer::error::TrainerError;
use trainer::session::{self, TrainOptions};
use trainer::training::Settings;

use super::mains::mains_hz;
use super::shape::ShapeArgs;
use super::terminal::Terminal;

/// Number of windows in a batch; each batch is one update of the parameters.
pub(crate) const BATCH: usize = 32;

/// Arguments of `trainer train`.
#[derive(Args, Debug)]
pub(crate) struct TrainArgs {
    /// Folder in which names of recordings are searched.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings (EDF, BDF, GDF) to train on: files, folders, patterns such as 'S001*.edf', ends of the names of
    /// files in --data, or ranges of them like R03..R10.
    #[arg(long, required = true, value_delimiter = ',')]
    train: Vec<String>,
    /// Recordings to test with; they are not used for training or validation. Without them the model has no test
    /// figures.
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
    #[command(flatten)]
    shape: ShapeArgs,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long, value_parser = mains_hz)]
    mains: u32,
    /// Origin and licence of the recordings, for the training card.
    #[arg(long, default_value = "not stated")]
    dataset: String,
    /// References to cite, for the training card.
    #[arg(long, default_value = "not stated")]
    citation: String,
    /// Number of epochs. With --resume, more than the checkpoint's: another cycle of the learning rate begins.
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
    /// Folder to write a report to: learning curves, error of each electrode, rate and error, as pictures with their
    /// values and a page that shows them.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace an artifact in the folder of --out, and a report in that of --report.
    #[arg(long)]
    force: bool,
}

impl TrainArgs {
    /// Trains a model, and prints its figures on the test recordings.
    pub(crate) fn run(self) -> Result<(), TrainerError> {
        let options = TrainOptions {
            montage: self.shape.montage()?,
            shape: Shape::from(&self.shape),
            data: self.data,
            train: self.train,
            test: self.test,
            mains_hz: self.mains,
            dataset: self.dataset,
            citation: self.citation,
            settings: Settings {
                epochs: self.epochs,
                batch: BATCH,
                peak_rate: self.learning_rate,
                seed: self.seed,
            },
            checkpoint: self.checkpoint,
            resume: self.resume,
            out: self.out,
            report: self.report,
            force: self.force,
        };
        if let Some(comparison) = session::train(&options, &mut Terminal::new()?)? {
            print!("{comparison}");
        }
        Ok(())
    }
}
