//! `cargo xtask bench`: instructions on an emulated microcontroller, noise, pictures of both, and codes
//! per second on this PC.

mod counts;
pub(crate) mod drawing;
mod elf;
pub(crate) mod emulator;
mod encoder;
mod host;
mod impulse;
pub(crate) mod inputs;
mod noise;
mod portable;
mod published;
mod report;
mod spectrum;
pub(crate) mod twin;

use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Subcommand;
use indicatif::{ProgressBar, ProgressStyle};

use self::counts::Counts;
use self::emulator::{Image, MACHINES, Machine};
use self::inputs::Inputs;
use self::noise::Noise;
use self::report::Report;
use self::twin::Twin;
use crate::failure::Failure;

/// An image is silent for no longer than this: measured 3 s on one loaded core.
const PATIENCE: Duration = Duration::from_mins(2);

/// What can be measured.
#[derive(Debug, Clone, Copy, Subcommand)]
pub(crate) enum BenchOptions {
    /// The filters: instructions, noise, response.
    Filters {
        /// Print one JSON object instead of a table.
        #[arg(long)]
        json: bool,
    },
    /// The encoder: instructions step by step, kernel by kernel; memory.
    Encoder {
        /// Print one JSON object instead of a table.
        #[arg(long)]
        json: bool,
        /// Windows that are encoded and compared, over all inputs.
        #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(100..=100_000))]
        windows: u32,
    },
    /// The encoder on this PC: codes per second on one core, beside PyTorch's.
    Host {
        /// Print one JSON object instead of a table.
        #[arg(long)]
        json: bool,
    },
}

impl BenchOptions {
    /// The filters, as a table.
    pub(crate) const FILTERS: Self = Self::Filters { json: false };
    /// The encoder, as a table.
    pub(crate) const ENCODER: Self = Self::Encoder {
        json: false,
        windows: 1000,
    };
}

/// Measures, prints, draws.
///
/// # Errors
/// QEMU or the target is missing, an image does not build or run, or a figure passes its limit.
pub(crate) fn bench(options: BenchOptions) -> Result<(), Failure> {
    match options {
        BenchOptions::Filters { json } => {
            let report = filters()?;
            print(json, || report.json(), &report);
            report.judge()
        }
        BenchOptions::Encoder { json, windows } => {
            let report = encoder::measure(windows as usize)?;
            print(json, || report.json(), &report);
            report.judge()
        }
        BenchOptions::Host { json } => {
            let report = host::measure()?;
            print(json, || report.json(), &report);
            report.judge()
        }
    }
}

/// One object, or a table.
fn print(json: bool, object: impl FnOnce() -> String, table: &impl Display) {
    if json {
        println!("{}", object());
    } else {
        print!("{table}");
    }
}

fn filters() -> Result<Report, Failure> {
    let image = Image::build("bench", "filters", &[])?;
    let folder = image.target_folder().join("bench");
    let inputs = Inputs::make()?;
    for skipped in &inputs.skipped {
        eprintln!("SKIPPED: {skipped}");
    }
    let expected = portable::outputs(&inputs);
    let lines = inputs.names.len() * bench::contender::NAMES.len();
    let progress = progress_bar(MACHINES.len() * lines + Noise::STAGES);

    let mut counts = Vec::new();
    for machine in MACHINES {
        let work = folder.join(machine.name);
        let (said, came_out) = run(&image, machine, &work, &inputs.bytes, &progress)?;
        counts.push(Counts::new(machine, &said, &inputs, &expected, &came_out)?);
    }
    let twin = Twin::of_the_model()?;
    let noise = Noise::measure(&twin, |what| {
        progress.inc(1);
        progress.set_message(what);
    });
    progress.finish_and_clear();

    let pictures = drawing::draw_all(&noise, &twin, &folder);
    pictures.map_err(|error| Failure::Check {
        what: "drawing the pictures".to_owned(),
        why: error.to_string(),
        next: format!("is {} writable, and the disk not full?", folder.display()),
    })?;
    eprintln!("pictures: {}", folder.display());
    Ok(Report::new(&inputs, &counts, &noise))
}

/// Runs the image on these inputs in `folder`: what it said, and what came out.
fn run(
    image: &Image,
    machine: Machine,
    folder: &Path,
    inputs: &[u8],
    progress: &ProgressBar,
) -> Result<(Vec<String>, Vec<u8>), Failure> {
    make_folder(folder)?;
    let input = folder.join(bench::block::INPUTS);
    fs::write(&input, inputs).map_err(|error| cannot_write(&input, &error))?;
    progress.set_message(machine.name);
    let mut command = image.command(machine, folder, &[]);
    // One instruction lasts 2^10 ns of the machine's time, whatever the host does.
    command.args(["-icount", "shift=10", "-serial", "none"]);
    let said = emulator::run_to_end(&mut command, PATIENCE, |_| progress.inc(1))?;
    let output = folder.join(bench::block::OUTPUTS);
    let came_out = fs::read(&output).map_err(|error| cannot_write(&output, &error))?;
    Ok((said, came_out))
}

pub(crate) fn make_folder(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))
}

pub(crate) fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    Failure::Check {
        what: format!("the file {}", PathBuf::from(path).display()),
        why: error.to_string(),
        next: "is its folder writable, and the disk not full?".to_owned(),
    }
}

/// One tick for every line that an image says and every part of the noise measurement.
fn progress_bar(ticks: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}");
    let bar = ProgressBar::new(ticks.try_into().unwrap_or(u64::MAX));
    match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
