//! Options of the command line.

use std::{convert::Infallible, num::NonZero, path::PathBuf, str::FromStr, time::Duration};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use host_sim::{Contact, Fault, Output, Trigger, fault_help};
use link::{MAX_RATE, Streams};
use offline::{CodeKind, SignalFormat};
use pipeline::Mains;
use recordings::Missing;

/// Virtual board: passes EEG through the firmware's pipeline and makes the same codes, bit for bit.
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
    Inspect {
        /// EDF, BDF or GDF file.
        file: PathBuf,
    },
    /// Rehearse sessions with faults, in virtual time: board, faulty line and the bridge's core.
    Scenario(ScenarioOptions),
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
        Ok(if text == "synthetic" { Self::Synthetic } else { Self::Recording(text.into()) })
    }
}

#[expect(clippy::struct_excessive_bools, reason = "options without a value")]
#[derive(Debug, Args)]
pub(crate) struct RunOptions {
    /// EDF, BDF or GDF file, or the word `synthetic`: EEG from dipoles in a spherical head, against
    /// linked ear lobes, with blinks, alpha and mains.
    #[arg(long, value_name = "FILE|synthetic")]
    pub(crate) input: Input,
    /// Destination of the frames: pty:PATH, tcp:HOST:PORT (listens) or file:PATH; ndjson:PATH for
    /// lines of JSON. The path - is standard output.
    #[arg(long, value_name = "OUTPUT")]
    pub(crate) output: Output,
    /// Streams to write to a file: or ndjson: output; by default codes, or packed blocks if the
    /// model has no network.
    #[arg(long, value_parser = stream(), value_delimiter = ',')]
    pub(crate) streams: Vec<Streams>,
    /// Replace the file of --output if it exists; the file of --input is never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    /// Process samples when they are due, as on a board (default for pty and tcp).
    #[arg(long, conflicts_with = "fast")]
    pub(crate) realtime: bool,
    /// Process samples as fast as the host reads the frames (default for file and ndjson).
    #[arg(long)]
    pub(crate) fast: bool,
    /// Error of the board's clock in real time, ppm; positive: the clock is fast.
    #[arg(long, value_name = "PPM", value_parser = parse_ppm, default_value_t = 0.0, allow_negative_numbers = true, conflicts_with = "fast")]
    pub(crate) clock_ppm: f64,
    /// Mains frequency of the notch until a host selects another one, Hz.
    #[arg(long, value_parser = mains(), default_value = "50")]
    pub(crate) mains: Mains,
    /// Stop after this many seconds of signal; while no host receives it, real time counts instead.
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) duration: Option<f64>,
    /// Treatment of montage electrodes that the recording lacks.
    #[arg(long, value_parser = missing(), default_value = "interpolate")]
    pub(crate) missing: Missing,
    /// Seed of the synthetic EEG: it determines where the dipoles are, and all random numbers.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Drive single electrodes of the synthetic EEG to the ADC's rail at random times.
    #[arg(long)]
    pub(crate) rails: bool,
    /// Inject a fault into a converter or an electrode, such as dead@3s:chip0; can be repeated.
    /// --help lists the faults.
    #[arg(long, value_name = "FAULT", long_help = fault_help())]
    pub(crate) fault: Vec<Fault>,
    /// Impedance of all electrodes, such as 5k, or of one, such as 40k:Cz; can be repeated. The
    /// default is 5k. `corticode-bridge impedance` measures it.
    #[arg(long, value_name = "OHMS[:ELECTRODE]")]
    pub(crate) impedance: Vec<Contact>,
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
pub(crate) struct EncodeOptions {
    /// EDF, BDF or GDF file, or a folder whose recordings are encoded.
    pub(crate) input: PathBuf,
    /// File of codes to write, or a folder if the input is a folder: NAME.edf becomes
    /// NAME.edf.codes.
    pub(crate) output: PathBuf,
    /// Mains frequency of the notch, Hz.
    #[arg(long, value_parser = mains(), default_value = "50")]
    pub(crate) mains: Mains,
    /// Treatment of montage electrodes that a recording lacks.
    #[arg(long, value_parser = missing(), default_value = "interpolate")]
    pub(crate) missing: Missing,
    /// What to write: codes of the network, or packed blocks, which take a quarter of the bits.
    #[arg(long, value_parser = kind(), default_value = DEFAULT_KIND)]
    pub(crate) stream: CodeKind,
    /// Rate of the packed blocks, 0 (finest) to 15; each step is 3 dB coarser; by default the
    /// model's.
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_RATE)))]
    pub(crate) packed_rate: Option<u8>,
    #[command(flatten)]
    pub(crate) batch: BatchOptions,
}

#[derive(Debug, Args)]
pub(crate) struct ScenarioOptions {
    /// Scenarios: TOML files, see docs/scenarios.md.
    #[arg(required = true)]
    pub(crate) files: Vec<PathBuf>,
    /// Write the verdicts to this file, as JUnit XML.
    #[arg(long, value_name = "FILE")]
    pub(crate) junit: Option<PathBuf>,
    /// Print a line of JSON with all figures for each scenario, instead of its verdict.
    #[arg(long)]
    pub(crate) json: bool,
    /// Replace the file of --junit if it exists.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print no progress bar.
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Default of `encode --stream`: codes if the built-in model has a network, else packed blocks.
const DEFAULT_KIND: &str = if model::HAS_NETWORK { "codes" } else { "packed" };

#[derive(Debug, Args)]
pub(crate) struct DecodeOptions {
    /// File of codes or of packed blocks, or a folder with files *.codes.
    pub(crate) input: PathBuf,
    /// File to write, or a folder if the input is a folder; by default NAME.decoded.FORMAT next to
    /// NAME.codes.
    pub(crate) output: Option<PathBuf>,
    /// Format of the decoded signal.
    #[arg(long, value_parser = format())]
    pub(crate) to: SignalFormat,
    /// What to decode of a file that holds codes and packed blocks; by default the kind that comes
    /// first.
    #[arg(long, value_parser = kind())]
    pub(crate) stream: Option<CodeKind>,
    /// Folder of the model that decodes; by default the model with which this program was built.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    /// Recording from which the codes were made; for a folder of codes, a folder of recordings,
    /// with NAME.edf for NAME.edf.codes. Its events are written to the output, and its signal is
    /// compared with the decoded one.
    #[arg(long, value_name = "FILE|FOLDER")]
    pub(crate) original: Option<PathBuf>,
    /// Write a report to this folder: index.html, electrodes.csv and pictures.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) report: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) batch: BatchOptions,
}

#[derive(Debug, Args)]
pub(crate) struct BatchOptions {
    /// Replace outputs that exist; inputs are never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    /// Number of files to process at a time; by default one for each core.
    #[arg(long, short, value_name = "NUMBER")]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Print no progress bar and no summary; warnings about the input are printed.
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// Returns a parser that accepts the words of `choices`. Each word has a help text and the value
/// that it stands for.
fn one_of<T: Clone + Send + Sync + 'static, const N: usize>(
    choices: [(&'static str, &'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    let values = choices.each_ref();
    let values = values.map(|(word, help, _)| PossibleValue::new(*word).help(*help));
    PossibleValuesParser::new(values).map(move |word| {
        let mut chosen = choices.iter().filter(|(choice, ..)| *choice == word);
        let (.., value) = chosen.next().expect("one of the possible values");
        value.clone()
    })
}

fn stream() -> impl TypedValueParser<Value = Streams> {
    one_of([
        ("codes", "Codes of the network", Streams::CODES),
        ("packed", "Packed blocks", Streams::PACKED),
        ("events", "Edges of the trigger input", Streams::EVENTS),
    ])
}

fn kind() -> impl TypedValueParser<Value = CodeKind> {
    one_of([
        ("codes", "Codes of the network", CodeKind::Codes),
        ("packed", "Packed blocks", CodeKind::Packed),
    ])
}

fn format() -> impl TypedValueParser<Value = SignalFormat> {
    let edf = "EDF+: 16 bits, tenths of a microvolt, up to 3276.7 uV";
    let bdf = "BDF+: 24 bits over the ADC's full scale";
    one_of([
        ("edf", edf, SignalFormat::Edf),
        ("bdf", bdf, SignalFormat::Bdf),
        ("gdf", "GDF 2.20: float32", SignalFormat::Gdf),
        ("npz", "Arrays for numpy.load: float32", SignalFormat::Npz),
        ("csv", "One line per step", SignalFormat::Csv),
    ])
}

fn missing() -> impl TypedValueParser<Value = Missing> {
    let interpolate = "Interpolate missing electrodes from the four nearest ones";
    one_of([
        ("interpolate", interpolate, Missing::Interpolate),
        ("zero", "Set missing electrodes to 0", Missing::Zero),
        ("refuse", "Refuse the recording", Missing::Refuse),
    ])
}

fn mains() -> impl TypedValueParser<Value = Mains> {
    PossibleValuesParser::new(["50", "60"]).map(|hz| match &*hz {
        "60" => Mains::Hz60,
        _ => Mains::Hz50,
    })
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if f64::is_finite(seconds) && seconds > 0.0 => Ok(seconds),
        _ => Err("write a positive number of seconds, such as 15 or 0.5".to_owned()),
    }
}

fn parse_ppm(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(ppm) if (-1e5..=1e5).contains(&ppm) => Ok(ppm),
        _ => Err("write a number of ppm from -100000 to 100000, such as -40 or 10000".to_owned()),
    }
}

fn parse_trigger(text: &str) -> Result<Trigger, String> {
    let interval = Duration::try_from_secs_f64(parse_seconds(text)?);
    let interval = interval.map_err(|error| error.to_string())?;
    Trigger::every(interval).map_err(|error| error.to_string())
}
