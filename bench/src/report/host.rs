//! The benchmark `host`: codes per second on one core of this PC, ours and PyTorch's.

mod agreement;
mod ours;
mod torch;

use std::env;
use std::path::{Path, PathBuf};

use model::CODE;

use self::ours::{Ours, WINDOWS};
use self::torch::Torch;
use super::failure::Failure;
use super::figures::Report;
use super::{checked_in, tools};

/// Number of rounds in which every contender is timed once; one more before them warms up.
const ROUNDS: usize = 9;

/// Codes per second of one round, in the order of [`STREAMING`] to [`TORCH_BATCH`]; `None` without PyTorch.
type Round = [Option<f64>; 5];

/// Index in [`Round`] of our encoder on the stream of time steps.
const STREAMING: usize = 0;
/// Index in [`Round`] of our encoder window by window, without use of the overlap.
const BY_WINDOW: usize = 1;
/// Index in [`Round`] of our acquisition and encoder on ADC samples.
const PIPELINE: usize = 2;
/// Index in [`Round`] of PyTorch with one window per call.
const TORCH: usize = 3;
/// Index in [`Round`] of PyTorch with all windows in one call.
const TORCH_BATCH: usize = 4;

/// Figures of speed: name, contender and, for a ratio, the contender by which it is divided.
const SPEEDS: [(&str, usize, Option<usize>); 8] = [
    ("codes_per_second", STREAMING, None),
    ("ratio_torch", STREAMING, Some(TORCH)),
    ("codes_per_second_windows", BY_WINDOW, None),
    ("codes_per_second_pipeline", PIPELINE, None),
    ("torch_codes_per_second", TORCH, None),
    ("torch_codes_per_second_batch", TORCH_BATCH, None),
    ("ratio_torch_batch", STREAMING, Some(TORCH_BATCH)),
    ("ratio_torch_windows_batch", BY_WINDOW, Some(TORCH_BATCH)),
];

/// Times our encoder and PyTorch in turns, and compares their codes.
///
/// # Errors
/// PyTorch does not run, or a contender's codes are incomplete.
pub(crate) fn measure() -> Result<Report, Failure> {
    let artifact = checked_in::artifact()?;
    let mut ours = Ours::new()?;
    let windows = ours.float_windows(artifact.description.input.sd_uv);
    let folder = target_folder()?.join("bench").join("host");
    let mut torch = Torch::start(&folder, &windows)?;

    let reference = agreement::reference(&artifact, &windows)?;
    let int8_rms_levels = agreement::rms_levels(&complete(ours.codes()?)?, &reference);
    let torch_relative = match torch {
        Some(_) => {
            let codes = complete(Torch::codes(&folder)?)?;
            Some(agreement::relative(&codes, &reference))
        }
        None => None,
    };

    let progress = tools::progress_bar(ROUNDS + 1);
    let mut rounds = Vec::new();
    for _ in 0..=ROUNDS {
        let mut speed = |mode| torch.as_mut().map(|torch| torch.time(mode)).transpose();
        rounds.push([
            Some(ours.streaming()),
            Some(ours.by_window()),
            Some(ours.pipeline()),
            speed("single")?,
            speed("batch")?,
        ]);
        progress.inc(1);
    }
    progress.finish_and_clear();
    let mut report = report(&rounds[1..], int8_rms_levels, torch_relative);
    report.detail("torch", torch.map(|torch| torch.version.clone()));
    Ok(report)
}

/// Checks that there is a code for every window.
fn complete<T>(codes: Vec<T>) -> Result<Vec<T>, Failure> {
    let (length, expected) = (codes.len(), WINDOWS * CODE);
    if length == expected {
        return Ok(codes);
    }
    Err(Failure::input(format!(
        "the codes have {length} values, {expected} are expected"
    )))
}

/// Returns cargo's target folder: this program is in a folder of it.
///
/// # Errors
/// The system does not report the program's path.
fn target_folder() -> Result<PathBuf, Failure> {
    let program = env::current_exe().map_err(|error| {
        let next = "`cargo run --release --package bench --bin report -- host`";
        Failure::new("finding cargo's target folder", error, next)
    })?;
    let target = program.ancestors().nth(2).unwrap_or(Path::new("."));
    Ok(target.to_owned())
}

/// Reports medians over the rounds. A ratio is the median of the rounds' ratios, because other load of the PC slows
/// all contenders of a round equally. No speed has a limit, because it depends on the PC.
fn report(rounds: &[Round], int8_rms_levels: f64, torch_relative: Option<f64>) -> Report {
    let next = "compare bench/torch_encoder.py with the mode and the network in \
                model/artifact/model.toml";
    let mut report = Report::new("host", next);
    for (name, contender, divisor) in SPEEDS {
        let unit = if divisor.is_some() {
            "times"
        } else {
            "codes/s"
        };
        let figures = rounds.iter().map(|round| {
            let divisor = divisor.map_or(Some(1.0), |divisor| round[divisor]);
            Some(round[contender]? / divisor?)
        });
        report.optional(name, unit, figures.collect::<Option<_>>().map(median));
    }
    report.figure("int8_rms_steps", "levels from floats", int8_rms_levels);
    report.optional("torch_relative", "of the largest float", torch_relative);
    report.detail("arch", env::consts::ARCH);
    report.detail("threads", 1);
    report.detail("rounds", rounds.len());
    report
}

/// Returns the median of `figures`, or 0 if there are none.
fn median(mut figures: Vec<f64>) -> f64 {
    figures.sort_by(f64::total_cmp);
    figures.get(figures.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn synthetic(with_torch: bool, torch_relative: f64) -> Report {
        // The last round ran on a busy PC.
        let rounds = [1.0, 1.1, 0.1].map(|speed| {
            let torch = |codes: f64| with_torch.then_some(codes * speed);
            let ours = [8_000.0, 4_000.0, 7_000.0].map(|codes| Some(codes * speed));
            [ours[0], ours[1], ours[2], torch(1_000.0), torch(5_000.0)]
        });
        report(&rounds, 0.5, with_torch.then_some(torch_relative))
    }

    #[test]
    fn a_ratio_is_that_of_a_round_and_a_slow_round_does_not_count() {
        let report = synthetic(true, 1e-7);
        let json = report.json();
        assert_eq!(json["codes_per_second"], 8_000.0);
        assert_eq!(json["codes_per_second_windows"], 4_000.0);
        assert_eq!(json["codes_per_second_pipeline"], 7_000.0);
        assert_eq!(json["ratio_torch"], 8.0);
        assert_eq!(json["ratio_torch_batch"], 1.6);
        assert_eq!(json["ratio_torch_windows_batch"], 0.8);
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn without_torch_its_figures_are_null_and_the_table_says_so() {
        let report = synthetic(false, 0.0);
        let json = report.json();
        assert!(json["codes_per_second"].is_f64());
        assert!(json["ratio_torch"].is_null() && json["torch_relative"].is_null());
        assert!(report.to_string().contains("not measured"));
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn other_codes_are_a_fault_whatever_the_speed() {
        assert_eq!(synthetic(true, 0.1).faults().len(), 1);
    }
}
