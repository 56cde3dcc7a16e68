//! `trainer evaluate`.

use clap::Args;
use std::path::PathBuf;
use trainer::comparison;
use trainer::error::TrainerError;

use super::mains::mains_hz;
use super::terminal::Terminal;

/// Arguments of `trainer evaluate`.
#[derive(Args, Debug)]
pub(crate) struct EvaluateArgs {
    /// Folder to read the artifact from.
    #[arg(long)]
    artifact: PathBuf,
    /// Folder in which names of recordings are searched.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings to test with: files, folders, patterns, ends of the names of files in --data, or ranges of them
    /// like R11..R12 [default: those in the training card].
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
    /// Mains frequency of the recordings, Hz: 50 or 60 [default: that of the training].
    #[arg(long, value_parser = mains_hz)]
    mains: Option<u32>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

impl EvaluateArgs {
    /// Prints the figures of the model and of its PCA.
    pub(crate) fn run(&self) -> Result<(), TrainerError> {
        let terminal = &mut Terminal::new()?;
        let comparison =
            comparison::compare(&self.artifact, &self.data, &self.test, self.mains, terminal)?;
        if self.json {
            println!("{:#}", comparison.to_json());
        } else {
            print!("{comparison}");
        }
        Ok(())
    }
}
