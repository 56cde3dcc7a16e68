//! The program `corticode-bridge`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    bridge::run()
}
