//! The benchmark `host`: codes per second on one core of this PC, ours and PyTorch's.

mod agreement;
mod ours;
mod torch;

use std::env;

use serde_json::json;

use self::ours::Ours;
use self::torch::Torch;
use super::checked_in;
use super::figures::Report;

/// Number of rounds in which every contender is timed once; one more before them warms up.
const ROUNDS: usize = 9;

/// Codes per second of the contenders in one round; those of PyTorch are `None` where it is not installed.
#[derive(Debug, Clone, Copy)]
struct Round {
    /// Our encoder on the stream of time steps.
    streaming: f64,
    /// Our encoder window by window, without use of the overlap.
    by_window: f64,
    /// Our acquisition and encoder on ADC samples.
    pipeline: f64,
    /// PyTorch with one window per call.
    torch: Option<f64>,
    /// PyTorch with all windows in one call.
    torch_batch: Option<f64>,
}

/// Times our encoder and PyTorch in turns, and compares their codes.
///
/// # Errors
/// PyTorch does not run, or a contender's codes are incomplete.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let artifact = checked_in::artifact()?;
    let mut ours = Ours::new()?;
    let windows = ours.float_windows(artifact.description.input.sd_uv);
    let reference = agreement::reference(&artifact, &windows)?;
    let int8_rms_levels = agreement::rms_levels(&ours.codes()?, &reference);
    let python = Torch::find();
    eprintln!("timing each encoder {ROUNDS} times");
    let mut rounds = Vec::new();
    let mut answer = None;
    for _ in 0..=ROUNDS {
        answer = python
            .as_ref()
            .map(|torch| torch.encode(&windows))
            .transpose()?;
        rounds.push(Round {
            streaming: ours.streaming(),
            by_window: ours.by_window(),
            pipeline: ours.pipeline(),
            torch: answer.as_ref().map(|answer| answer.single),
            torch_batch: answer.as_ref().map(|answer| answer.batch),
        });
    }
    let torch_relative = answer
        .as_ref()
        .map(|answer| agreement::relative(&answer.codes, &reference));
    let version = answer.as_ref().map(|answer| answer.version.as_str());
    report(&rounds[1..], int8_rms_levels, torch_relative, version)
}

/// Reports medians over the rounds. A ratio is the median of the rounds' ratios, because other load of the PC slows
/// all contenders of a round equally. No speed has a limit, because it depends on the PC.
fn report(
    rounds: &[Round],
    int8_rms_levels: f64,
    torch_relative: Option<f64>,
    torch: Option<&str>,
) -> anyhow::Result<Report> {
    let median = |figure: fn(&Round) -> Option<f64>| {
        let mut figures: Vec<f64> = rounds.iter().map(figure).collect::<Option<_>>()?;
        figures.sort_by(f64::total_cmp);
        figures.get(figures.len() / 2).copied()
    };
    let figures = json!({
        "codes_per_second": median(|round| Some(round.streaming)),
        "codes_per_second_windows": median(|round| Some(round.by_window)),
        "codes_per_second_pipeline": median(|round| Some(round.pipeline)),
        "torch_codes_per_second": median(|round| round.torch),
        "torch_codes_per_second_batch": median(|round| round.torch_batch),
        "ratio_torch": median(|round| Some(round.streaming / round.torch?)),
        "ratio_torch_batch": median(|round| Some(round.streaming / round.torch_batch?)),
        "ratio_torch_windows_batch": median(|round| Some(round.by_window / round.torch_batch?)),
        // Distances of the codes from those in floats: in levels, and relative to the largest float.
        "int8_rms_steps": int8_rms_levels,
        "torch_relative": torch_relative,
        "arch": env::consts::ARCH,
        "threads": 1,
        "rounds": rounds.len(),
        "torch": torch,
    });
    let next =
        "compare bench/torch_encoder.py with the mode and the network in model/artifact/model.toml";
    Report::new("host", figures, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn synthetic(with_torch: bool, torch_relative: f64) -> Report {
        // The last round ran on a busy PC.
        let rounds = [1.0, 1.1, 0.1].map(|speed| Round {
            streaming: 8_000.0 * speed,
            by_window: 4_000.0 * speed,
            pipeline: 7_000.0 * speed,
            torch: with_torch.then_some(1_000.0 * speed),
            torch_batch: with_torch.then_some(5_000.0 * speed),
        });
        let torch_relative = with_torch.then_some(torch_relative);
        report(&rounds, 0.5, torch_relative, None).expect("a report")
    }

    #[test]
    fn a_ratio_is_that_of_a_round_and_a_slow_round_does_not_count() {
        let report = synthetic(true, 1e-7);
        for (name, value) in [
            ("codes_per_second", 8_000.0),
            ("codes_per_second_windows", 4_000.0),
            ("codes_per_second_pipeline", 7_000.0),
            ("ratio_torch", 8.0),
            ("ratio_torch_batch", 1.6),
            ("ratio_torch_windows_batch", 0.8),
        ] {
            assert_eq!(report.object[name], value, "{name}");
        }
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn without_torch_its_figures_are_null_and_the_table_says_so() {
        let report = synthetic(false, 0.0);
        let json = &report.object;
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
