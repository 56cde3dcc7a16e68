//! The program `report`: runs a benchmark, prints its figures, and checks them against
//! `tests/bench/limits.toml`.

mod checked_in;
mod cost;
mod encoder;
mod figures;
mod filters;
mod images;
mod inputs;
mod lossless;
mod models;
mod nodes;
mod offline;
mod packed;
mod programs;
mod substitution;
mod table;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use emulator::EmulatorError;

/// Environment variable with the path of a file to which the benchmark writes its figures as a JSON
/// object, with or without `--json`.
const OBJECT: &str = "CORTICODE_OBJECT";

#[derive(Debug, Parser)]
#[command(
    name = "report",
    about = "Runs a benchmark and checks its figures against tests/bench/limits.toml"
)]
struct Options {
    #[command(subcommand)]
    benchmark: Benchmark,
    /// Print one JSON object instead of tables.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Clone, Subcommand)]
enum Benchmark {
    /// Filters: instructions on emulated microcontrollers, and noise.
    Filters,
    /// Encoder: instructions of each time step and kernel on emulated microcontrollers, memory, and
    /// computed cycles.
    Encoder {
        /// Number of windows that are encoded and compared with the PC's, over all inputs.
        #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(100..=100_000))]
        windows: u32,
    },
    /// Packed code: instructions of each hop on emulated microcontrollers, memory, bytes compared
    /// with this PC's, and bits and error on recordings.
    Packed {
        /// Number of hops that are encoded of each input.
        #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u32).range(65..=1_500))]
        hops: u32,
    },
    /// Lossless compression: bits per channel sample; instructions on emulated microcontrollers.
    Lossless,
    /// Bad electrodes: instructions to find and fill them on emulated microcontrollers, steps
    /// compared with this PC's.
    Substitution,
    /// Cost of a model: instructions of each time step on emulated microcontrollers, flash and RAM
    /// of the boards' images. Fails when a code differs from the batch reference's, or an image
    /// does not fit its board.
    Model {
        /// Folder of the model, as `trainer train` writes it.
        folder: PathBuf,
        /// Number of windows that are encoded and compared with the reference, over all inputs.
        #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(20..=100_000))]
        windows: u32,
    },
    /// Cost, measured as by `model`, of models with random weights: one for each file in
    /// `files/montages/`.
    Montages {
        /// Measure only the montage of this name.
        #[arg(long)]
        montage: Option<String>,
        /// Number of windows that are encoded and compared for each model, over all inputs.
        #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(20..=100_000))]
        windows: u32,
    },
    /// Recordings encoded and decoded on one core of this PC, as multiples of real time; scipy and
    /// PyTorch for comparison, where they are installed.
    Offline {
        /// Duration of the synthetic recording, seconds.
        #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u32).range(20..=86_400))]
        seconds: u32,
    },
    /// Bridge on this PC: intervals and latency of codes at a subscriber, processor time and
    /// memory; a node in rospy for comparison, where it is installed.
    Bridge {
        /// Duration of each of the two parts (codes alone; also reconstructed signals), seconds.
        #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(2..=86_400))]
        seconds: u32,
    },
    /// Node for other amplifiers on this PC: intervals and latency of codes at a subscriber; a node
    /// in rospy for comparison, where it is installed.
    Node {
        /// Rate of the amplifier, Hz; by default that of the model's ADC.
        #[arg(long, value_parser = clap::value_parser!(u16).range(128..=20_000))]
        rate: Option<u16>,
        /// Duration of the measurement, seconds.
        #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(2..=86_400))]
        seconds: u32,
    },
}

/// Runs the program; exits with 1 when a check failed and with 2 when something must be installed.
pub fn main() -> ExitCode {
    let Err(error) = run(&Options::parse()) else {
        return ExitCode::SUCCESS;
    };
    eprintln!("\nerror: {error}");
    error.chain().skip(1).for_each(|why| eprintln!("  why: {why}"));
    let emulator = error.downcast_ref::<EmulatorError>();
    let is_missing = emulator.is_some_and(EmulatorError::is_missing);
    ExitCode::from(if is_missing { 2 } else { 1 })
}

fn run(options: &Options) -> anyhow::Result<()> {
    let report = match &options.benchmark {
        Benchmark::Filters => filters::measure()?,
        Benchmark::Encoder { windows } => encoder::measure(*windows as usize)?,
        Benchmark::Packed { hops } => packed::measure(*hops as usize)?,
        Benchmark::Lossless => lossless::measure()?,
        Benchmark::Substitution => substitution::measure()?,
        Benchmark::Model { folder, windows } => models::measure_folder(folder, *windows as usize)?,
        Benchmark::Montages { montage, windows } => {
            models::measure_montages(montage.as_deref(), *windows as usize, true)?
        }
        Benchmark::Offline { seconds } => offline::measure(*seconds)?,
        Benchmark::Bridge { seconds } => nodes::bridge::measure(*seconds)?,
        Benchmark::Node { rate, seconds } => nodes::node::measure(*rate, *seconds)?,
    };
    if let Some(file) = std::env::var_os(OBJECT) {
        let file = Path::new(&file);
        let folder = file.parent().unwrap_or(Path::new("."));
        let written =
            fs::create_dir_all(folder).and_then(|()| fs::write(file, report.object.to_string()));
        written.map_err(EmulatorError::file(file))?;
    }
    if options.json {
        new_file::print(format_args!("{}\n", report.object))?;
    } else {
        new_file::print(&report)?;
    }
    report.outcome()
}
