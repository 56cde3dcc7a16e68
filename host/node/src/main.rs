//! The program `corticode-node`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    node::run()
}
