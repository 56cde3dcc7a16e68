//! Command line of the virtual board.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod batch;
mod command_line;
mod decode;
mod encode;
mod inspect;
mod rehearse;
mod run;

use std::{error::Error, process::ExitCode};

use clap::Parser as _;
use host_sim::SessionError;
use new_file::NewFileError;
use offline::OfflineError;

use batch::BatchError;
use command_line::{Command, CommandLine};
use rehearse::Failed;

/// Exit status of every failure before a run starts: the input or the options cannot be used.
const UNUSABLE: u8 = 2;

fn main() -> ExitCode {
    let outcome = match CommandLine::parse().command {
        Command::Run(options) => run::run(&options),
        Command::Encode(options) => encode::encode(&options),
        Command::Decode(options) => decode::decode(&options),
        Command::Inspect { file } => inspect::inspect(&file),
        Command::Scenario(options) => rehearse::rehearse_all(&options),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            new_file::message!("host-sim: {}", chain(&*error));
            let statuses = [
                error.downcast_ref().map(SessionError::exit_status),
                error.downcast_ref().map(OfflineError::exit_status),
                error.downcast_ref().map(BatchError::exit_status),
                error.downcast_ref().map(|_: &Failed| 1),
                // The status is 1 if standard output cannot be written any further.
                error.downcast_ref().map(|_: &NewFileError| 1),
            ];
            let status = statuses.into_iter().flatten().next();
            ExitCode::from(status.unwrap_or(UNUSABLE))
        }
    }
}

/// Formats an error and its causes, one per line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}\n  because: {error}");
        cause = error.source();
    }
    text
}
