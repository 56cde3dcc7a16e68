//! `trainer packed`.

use clap::Args;
use std::path::PathBuf;
use trainer::error::TrainerError;
use trainer::packed::{self, PackedOptions};

use super::mains::mains_hz;
use super::terminal::Terminal;

/// Arguments of `trainer packed`.
#[derive(Args, Debug)]
pub(crate) struct PackedArgs {
    /// Folder of the artifact that the packed model joins.
    #[arg(long)]
    artifact: PathBuf,
    /// Folder in which names of recordings are searched.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings to train on.
    #[arg(long, required = true, value_delimiter = ',')]
    train: Vec<String>,
    /// Recordings to test with.
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
    /// Number of coefficients of a block.
    #[arg(long, default_value_t = 192)]
    coefficients: usize,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long, value_parser = mains_hz)]
    mains: u32,
}

impl PackedArgs {
    pub(crate) fn run(self) -> Result<(), TrainerError> {
        let options = PackedOptions {
            artifact: self.artifact,
            data: self.data,
            train: self.train,
            test: self.test,
            coefficients: self.coefficients,
            mains_hz: self.mains,
        };
        packed::train(&options, &mut Terminal::new()?)?;
        Ok(())
    }
}
