//! `trainer packed`.

use artifact::MontageFile;
use clap::{ArgGroup, Args};
use std::path::PathBuf;
use trainer::error::TrainerError;
use trainer::packed::{self, AloneOptions, FitOptions, PackedOptions, PackedTrained, RateTable};

use super::mains::mains_hz;
use super::terminal::Terminal;

/// Arguments of `trainer packed`.
#[derive(Args, Debug)]
#[command(group = ArgGroup::new("model").args(["artifact", "montage"]).required(true))]
pub(crate) struct PackedArgs {
    /// Folder of the artifact that the packed model joins: its montage, hop and filters are used.
    #[arg(long)]
    artifact: Option<PathBuf>,
    #[command(flatten)]
    alone: AloneArgs,
    /// Folder in which names of recordings are searched.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings to train on: files, folders, patterns, ends of the names of files in --data, or ranges of them like
    /// R03..R10.
    #[arg(long, required = true, value_delimiter = ',')]
    train: Vec<String>,
    /// Recordings to test with. Without them the model has no test figures.
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
    /// Number of coefficients of a block: a multiple of 16 up to 256. Fewer need less flash and time; more reach a
    /// smaller error at fine rates [default: 176, or as many as the values of a block allow].
    #[arg(long)]
    coefficients: Option<usize>,
    /// Start the device with the coarsest rate whose mean squared error is at most this, in units of the training
    /// data's variance [default: rate 4].
    #[arg(long)]
    target_mse: Option<f64>,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long, value_parser = mains_hz)]
    mains: u32,
    /// Replace the packed model of --artifact, or the artifact in --out.
    #[arg(long)]
    force: bool,
}

/// Arguments of a model with the packed code alone.
#[derive(Args, Debug)]
struct AloneArgs {
    /// Montage file of a new model without a network: grid, order of the ADC's channels, ADC.
    #[arg(long, requires = "out")]
    montage: Option<PathBuf>,
    /// Folder to write the new model to.
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    out: Option<PathBuf>,
    /// Sampling rate of the new model's ADC, Hz [default: that of the montage].
    #[arg(
        long,
        value_name = "HZ",
        requires = "montage",
        conflicts_with = "artifact"
    )]
    rate: Option<u32>,
    /// Time steps of a block of the new model: 4, 8 or 16 [default: 8].
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    hop: Option<usize>,
    /// Origin and licence of the recordings, for the new model's training card [default: not stated].
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    dataset: Option<String>,
    /// References to cite, for the new model's training card [default: not stated].
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    citation: Option<String>,
}

impl PackedArgs {
    /// Trains a packed model, and prints its bits and errors at each rate, beside those of the same
    /// transform code without prediction.
    pub(crate) fn run(self) -> Result<(), TrainerError> {
        let trained = self.train()?;
        println!("packed code");
        print!("{}", RateTable(&trained.figures));
        println!("\nKLT of a block, coded alike, without prediction");
        print!("{}", RateTable(&trained.without_prediction));
        Ok(())
    }

    fn train(self) -> Result<PackedTrained, TrainerError> {
        let terminal = &mut Terminal::new()?;
        let fit = FitOptions {
            data: self.data,
            train: self.train,
            test: self.test,
            coefficients: self.coefficients,
            mains_hz: self.mains,
            target_mse: self.target_mse,
        };
        let force = self.force;
        let alone = self.alone;
        match (self.artifact, alone.montage, alone.out) {
            (_, Some(montage), Some(out)) => {
                let mut montage = MontageFile::read(&montage)?;
                montage.adc.rate_hz = alone.rate.unwrap_or(montage.adc.rate_hz);
                let not_stated = || "not stated".to_owned();
                let options = AloneOptions {
                    montage,
                    hop: alone.hop.unwrap_or(DEFAULT_HOP),
                    fit,
                    dataset: alone.dataset.unwrap_or_else(not_stated),
                    citation: alone.citation.unwrap_or_else(not_stated),
                    out,
                    force,
                };
                packed::train_alone(&options, terminal)
            }
            (artifact, ..) => {
                let artifact = artifact.expect("clap requires --artifact or --montage with --out");
                let options = PackedOptions {
                    artifact,
                    fit,
                    force,
                };
                packed::train(&options, terminal)
            }
        }
    }
}

/// Time steps of a block unless --hop states others.
const DEFAULT_HOP: usize = 8;
