//! `trainer packed`.

use clap::Args;
use std::path::PathBuf;
use trainer::error::TrainerError;
use trainer::packed::{self, PackedOptions, RateTable};

use super::mains::mains_hz;
use super::terminal::Terminal;

/// Arguments of `trainer packed`.
#[derive(Args, Debug)]
pub(crate) struct PackedArgs {
    /// Folder of the artifact that the packed model joins: its montage, hop and filters are used.
    #[arg(long)]
    artifact: PathBuf,
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
    /// Replace the packed model of the artifact.
    #[arg(long)]
    force: bool,
}

impl PackedArgs {
    /// Trains a packed model, and prints its bits and errors at each rate, beside those of the same
    /// transform code without prediction.
    pub(crate) fn run(self) -> Result<(), TrainerError> {
        let options = PackedOptions {
            artifact: self.artifact,
            data: self.data,
            train: self.train,
            test: self.test,
            coefficients: self.coefficients,
            mains_hz: self.mains,
            target_mse: self.target_mse,
            force: self.force,
        };
        let trained = packed::train(&options, &mut Terminal::new()?)?;
        println!("packed code");
        print!("{}", RateTable(&trained.figures));
        println!("\nKLT of a block, coded alike, without prediction");
        print!("{}", RateTable(&trained.without_prediction));
        Ok(())
    }
}
