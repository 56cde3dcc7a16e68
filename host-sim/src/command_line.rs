//! Options of the command line.

use std::{convert::Infallible, path::PathBuf, str::FromStr, time::Duration};

use clap::{Args, Parser, Subcommand};
use host_sim::{Fault, Output, Trigger, fault_help};

use crate::mains_hz::MainsHz;
use crate::missing_electrodes::MissingElectrodes;
use crate::offline_options::{DecodeOptions, EncodeOptions};

/// Virtual board: plays EEG through the firmware's pipeline, bit for bit.
#[derive(Debug, Parser)]
#[command(version)]
pub(crate) struct CommandLine {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run the virtual board on a recording or on synthetic EEG.
    Run(RunOptions),
    /// Encode recordings to files of codes, as fast as the PC can.
    Encode(EncodeOptions),
    /// Decode files of codes to files of signals, and report the error.
    Decode(DecodeOptions),
    /// Show what a recording holds and how it fits the model's montage.
    Inspect(InspectOptions),
}

/// Source of the EEG, parsed from `--input`.
#[derive(Clone, Debug)]
pub(crate) enum Input {
    /// The generator of synthetic EEG.
    Synthetic,
    /// An EDF, BDF or GDF file.
    Recording(PathBuf),
}

impl FromStr for Input {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(if text == "synthetic" {
            Self::Synthetic
        } else {
            Self::Recording(text.into())
        })
    }
}

#[derive(Debug, Args)]
pub(crate) struct RunOptions {
    /// EDF, BDF or GDF file, or the word `synthetic`: EEG from dipoles in a spherical head, against linked
    /// ear lobes, with blinks, alpha and mains.
    #[arg(long, value_name = "FILE|synthetic")]
    pub(crate) input: Input,
    /// Destination of the frames: pty:PATH, tcp:HOST:PORT (listens) or file:PATH.
    #[arg(long, value_name = "OUTPUT")]
    pub(crate) output: Output,
    /// Replace the file of --output if it exists; the file of --input is never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) pace: PaceOptions,
    /// Mains frequency of the notch until a host selects another one, Hz.
    #[arg(long, value_enum, default_value = "50")]
    pub(crate) mains: MainsHz,
    /// Stop after this many seconds of signal, or without a host after the rest of this time.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) duration: Option<f64>,
    /// Treatment of montage electrodes that the recording lacks.
    #[arg(long, value_enum, default_value = "interpolate")]
    pub(crate) missing: MissingElectrodes,
    /// Seed of the synthetic EEG: places of the dipoles, and every random stream.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Drive single electrodes of the synthetic EEG to the ADC's rail at random times.
    #[arg(long)]
    pub(crate) rails: bool,
    /// Inject a fault into a converter or an electrode, such as dead@3s:chip0; can be repeated. --help
    /// lists the faults.
    #[arg(long, value_name = "FAULT", long_help = fault_help())]
    pub(crate) fault: Vec<Fault>,
    /// Generate trigger edges at this interval of device time, rising and falling in turn; a bridge
    /// publishes them on /events/bus.
    #[arg(long, value_name = "SECONDS", value_parser = parse_trigger)]
    pub(crate) trigger_every: Option<Trigger>,
    /// Session id that the board reports; by default random in real time, and 1 otherwise.
    #[arg(long, value_name = "NUMBER")]
    pub(crate) session_id: Option<u32>,
    /// Print no progress bar and no report; warnings about the input are printed.
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Debug, Args)]
pub(crate) struct PaceOptions {
    /// Process samples when they are due, as on a board (default for pty and tcp).
    #[arg(long, conflicts_with = "fast")]
    pub(crate) realtime: bool,
    /// Process samples as fast as the host reads the frames (default for file).
    #[arg(long)]
    pub(crate) fast: bool,
}

#[derive(Debug, Args)]
pub(crate) struct InspectOptions {
    /// EDF, BDF or GDF file.
    pub(crate) file: PathBuf,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if f64::is_finite(seconds) && seconds > 0.0 => Ok(seconds),
        _ => Err("write a positive number of seconds, such as 15 or 0.5".to_owned()),
    }
}

fn parse_trigger(text: &str) -> Result<Trigger, String> {
    let interval = Duration::try_from_secs_f64(parse_seconds(text)?);
    let interval = interval.map_err(|error| error.to_string())?;
    Trigger::every(interval).map_err(|error| error.to_string())
}
