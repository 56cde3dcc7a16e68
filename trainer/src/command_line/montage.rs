//! `trainer montage check`.

use artifact::MontageFile;
use clap::Subcommand;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use trainer::montage_check::MontageCheck;
use trainer::recording_check::RecordingCheck;

use super::terminal::print_error;

#[derive(Debug, Subcommand)]
pub(crate) enum MontageVerb {
    /// Print the grid of a montage and every mistake in it. Exit status: 0 no mistake, 2 mistakes.
    Check {
        /// Montage file.
        file: PathBuf,
        /// Recording (EDF, BDF, GDF) to compare: which electrodes it has, which are missing.
        #[arg(long)]
        recording: Option<PathBuf>,
    },
}

impl MontageVerb {
    /// Runs the command; returns the exit status.
    pub(crate) fn run(&self) -> ExitCode {
        let Self::Check { file, recording } = self;
        check_montage(file, recording.as_deref())
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
