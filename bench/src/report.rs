//! The program `report`: runs a benchmark, prints its figures, and checks them against `bench/limits.toml`.

mod checked_in;
mod encoder;
mod failure;
mod figures;
mod filters;
mod host;
mod images;
mod inputs;
mod limits;
mod table;
mod tools;

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use self::failure::Failure;

/// Environment variable that names a file to which the JSON object of `--json` is also written.
const OBJECT: &str = "CORTICODE_OBJECT";

#[derive(Debug, Parser)]
#[command(
    name = "report",
    about = "Runs a benchmark and checks its figures against bench/limits.toml"
)]
struct Options {
    #[command(subcommand)]
    benchmark: Benchmark,
    /// Print one JSON object instead of tables.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Clone, Copy, Subcommand)]
enum Benchmark {
    /// Filters: instructions on emulated microcontrollers, noise, response.
    Filters,
    /// Encoder: instructions of each time step and kernel on emulated microcontrollers, memory, cycles.
    Encoder {
        /// Number of windows that are encoded and compared, over all inputs.
        #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(100..=100_000))]
        windows: u32,
    },
    /// Encoder on this PC: codes per second on one core, and PyTorch's where it is installed.
    Host,
}

/// Runs the program; returns 1 when a check failed and 2 when something must be installed.
pub fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("\nerror: {failure}");
            failure.exit_code()
        }
    }
}

fn run(options: &Options) -> Result<(), Failure> {
    let (name, mut report) = match options.benchmark {
        Benchmark::Filters => ("filters", filters::measure()?),
        Benchmark::Encoder { windows } => ("encoder", encoder::measure(windows as usize)?),
        Benchmark::Host => ("host", host::measure()?),
    };
    report.judge(&limits::read(name)?);
    let next = "compare with `git log` of bench";
    let json = serde_json::to_string(&report)
        .map_err(|error| Failure::new("writing JSON", error, next))?;
    if let Some(file) = std::env::var_os(OBJECT) {
        let file = Path::new(&file);
        let folder = file.parent().unwrap_or(Path::new("."));
        let written = fs::create_dir_all(folder).and_then(|()| fs::write(file, &json));
        written.map_err(|error| Failure::new(file.display(), error, "is its folder writable?"))?;
    }
    if options.json {
        println!("{json}");
    } else {
        print!("{report}");
    }
    report.outcome()
}
