//! The program `model-gen`: shows, compares, checks and imports models.
#![forbid(unsafe_code)]

mod command_line;

use std::process::ExitCode;

fn main() -> ExitCode {
    command_line::run()
}
