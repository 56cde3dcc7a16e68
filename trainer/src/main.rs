//! The program `trainer`: see `command_line`.
#![forbid(unsafe_code)]

mod command_line;

use std::process::ExitCode;

fn main() -> ExitCode {
    command_line::run()
}
