//! Command line of the virtual board.

mod command_line;
mod inspect;
mod run;

use std::{error::Error, process::ExitCode};

use clap::Parser as _;

use command_line::{Command, CommandLine};

/// Exit status: a device, port or file could not be reached.
const UNREACHABLE: u8 = 3;

fn main() -> ExitCode {
    let outcome = match CommandLine::parse().command {
        Command::Run(options) => run::run(&options),
        Command::Inspect(options) => inspect::inspect(&options),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("host-sim: {}", chain(&*error));
            ExitCode::from(UNREACHABLE)
        }
    }
}

/// An error and its causes, one a line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}\n  because: {error}");
        cause = error.source();
    }
    text
}
