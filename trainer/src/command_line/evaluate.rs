//! `trainer evaluate`.

use clap::Args;
use new_file::Existing;
use std::path::PathBuf;
use trainer::comparison;
use trainer::error::TrainerError;
use trainer::progress::ProgressObserver;
use trainer::report;

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
    /// Folder to write a report to: error of each electrode, rate and error, as pictures with their values and a page
    /// that shows them.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace a report in this folder.
    #[arg(long, requires = "report")]
    force: bool,
}

impl EvaluateArgs {
    /// Prints the figures of the model and of its PCA.
    pub(crate) fn run(&self) -> Result<(), TrainerError> {
        if let Some(folder) = &self.report {
            report::prepare(folder, Existing::from_force(self.force))?;
        }
        let terminal = &mut Terminal::new()?;
        let comparison =
            comparison::compare(&self.artifact, &self.data, &self.test, self.mains, terminal)?;
        if let Some(folder) = &self.report {
            report::write_evaluation(folder, &comparison)?;
            terminal.message(&report::message(folder));
        }
        if self.json {
            println!("{:#}", comparison.to_json());
        } else {
            print!("{comparison}");
        }
        Ok(())
    }
}
