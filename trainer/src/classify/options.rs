//! Options of `trainer classify`.

use crate::selection::TrainingFiles;
use artifact::classifier::Class;
use packed_fit::band_pass::{parse_band, parse_range};
use std::path::PathBuf;

/// Longest time from an event to the start or the end of its trial, seconds.
const LONGEST_TRIAL_S: f64 = 120.0;

/// Options of `trainer classify`.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct ClassifyOptions {
    /// Folder of the model that the device runs: its montage, filters and hop are used.
    #[arg(long, default_value = "signal/model/artifact")]
    pub(super) artifact: PathBuf,
    #[command(flatten)]
    pub(super) files: TrainingFiles,
    /// Events that start the trials of each class, two or more, each as LABEL=CODE: the text of an
    /// annotation or the GDF type in the recordings, and the code of the class, such as
    /// T1=769,T2=770. A GDF type alone is its own code.
    #[arg(long, required = true, value_delimiter = ',', value_parser = class)]
    pub(super) events: Vec<Class>,
    #[command(flatten)]
    pub(super) task: TaskOptions,
    /// Length over which a decision averages, seconds [default: the length of --trial].
    #[arg(long, value_name = "S")]
    pub(super) window: Option<f64>,
    /// Number of spatial filters in all, up to 8 and a multiple of the number of classes [default:
    /// 6, or the next smaller multiple, but at least one for each class].
    #[arg(long)]
    pub(super) filters: Option<usize>,
    /// File to write the classifier to.
    #[arg(long)]
    pub(super) out: PathBuf,
    /// Folder to write a report to: patterns and probability over time as
    /// pictures with their values, and a page that shows them with the decisions on all trials.
    #[arg(long)]
    pub(crate) report: Option<PathBuf>,
    /// Replace the file of --out, and a report in the folder of --report.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What a decoder reads from a recording: a frequency band, and a part of each trial.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct TaskOptions {
    /// Lower and upper edge of the band-pass, Hz.
    #[arg(long, value_name = "HZ..HZ", default_value = "8..30", value_parser = parse_band)]
    pub(crate) band: [f64; 2],
    /// Start and end of the part of each trial that is used, seconds after its event.
    #[arg(long, value_name = "S..S", default_value = "0.5..4", requires = "events", value_parser = trial, allow_hyphen_values = true)]
    pub(super) trial: [f64; 2],
}

/// Parses a class, `LABEL=CODE` or `CODE`.
pub(crate) fn class(text: &str) -> Result<Class, String> {
    let (event, code) = text.rsplit_once('=').unwrap_or((text, text));
    let code = code.trim().parse().map_err(|_| {
        format!("{code} is no code: write LABEL=CODE with a whole number, such as T1=769")
    })?;
    if !Class::CODES.contains(&code) {
        let [least, most] = [Class::CODES.start(), Class::CODES.end()];
        return Err(format!("{code} is no code of an event: {least} to {most}"));
    }
    let event = event.trim().to_owned();
    Ok(Class { code, event })
}

/// Parses the part of a trial that is used, seconds after its event.
fn trial(text: &str) -> Result<[f64; 2], String> {
    let ends = parse_range(text)?;
    if ends.iter().any(|end| end.abs() > LONGEST_TRIAL_S) {
        return Err(format!("a trial is within {LONGEST_TRIAL_S} s of its event"));
    }
    Ok(ends)
}
