//! The program `trainer`, which runs [`trainer::command_line`].
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    trainer::command_line::run()
}
