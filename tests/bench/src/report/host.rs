//! The benchmark `host`: codes per second on one core of this PC, ours and PyTorch's.

mod agreement;
mod ours;
mod torch;

use std::env;

use serde_json::json;

use self::ours::Ours;
use self::torch::{Answer, Torch};
use super::checked_in;
use super::figures::Report;

/// Number of rounds; each times every contender once. One more round at the start is a warm-up and is not
/// counted.
const ROUNDS: usize = 9;

/// Codes per second of the contenders in one round.
#[derive(Debug)]
struct Round {
    /// Our encoder on the stream of time steps.
    streaming: f64,
    /// Our encoder window by window, without use of the overlap.
    by_window: f64,
    /// Our acquisition and encoder on ADC samples.
    pipeline: f64,
    /// PyTorch, where it is installed.
    torch: Option<Answer>,
}

/// Times our encoder and PyTorch alternately, and compares the codes of both with those in floats.
///
/// # Errors
/// PyTorch does not run, or a contender's codes are incomplete.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let artifact = checked_in::artifact()?;
    let mut ours = Ours::new()?;
    let windows = ours.float_windows(artifact.description.input.sd_uv);
    let reference = agreement::reference(&artifact, &windows)?;
    let int8_rms_levels = agreement::rms_levels(&ours.codes()?, &reference);
    let torch = Torch::find();
    eprintln!("timing each encoder {ROUNDS} times");
    let mut rounds = Vec::new();
    for _ in 0..=ROUNDS {
        rounds.push(Round {
            streaming: ours.streaming(),
            by_window: ours.by_window(),
            pipeline: ours.pipeline(),
            torch: torch
                .as_ref()
                .map(|torch| torch.encode(&windows))
                .transpose()?,
        });
    }
    let answer = rounds[ROUNDS].torch.as_ref();
    let torch_relative = answer.map(|answer| agreement::relative(&answer.codes, &reference));
    report(&rounds[1..], int8_rms_levels, torch_relative)
}

/// Returns the report, with medians over the rounds. A ratio is the median of the rounds' ratios, because
/// other load of the PC slows all contenders of a round equally. No speed has a limit, because it depends on
/// the PC.
fn report(
    rounds: &[Round],
    int8_rms_levels: f64,
    torch_relative: Option<f64>,
) -> anyhow::Result<Report> {
    let median = |figure: &dyn Fn(&Round) -> Option<f64>| {
        let mut figures: Vec<f64> = rounds.iter().map(figure).collect::<Option<_>>()?;
        figures.sort_by(f64::total_cmp);
        figures.get(figures.len() / 2).copied()
    };
    let single = |round: &Round| Some(round.torch.as_ref()?.single);
    let batch = |round: &Round| Some(round.torch.as_ref()?.batch);
    let version = rounds[0].torch.as_ref().map(|torch| &torch.version);
    let figures = json!({
        "codes_per_second": median(&|round| Some(round.streaming)),
        "codes_per_second_windows": median(&|round| Some(round.by_window)),
        "codes_per_second_pipeline": median(&|round| Some(round.pipeline)),
        "torch_codes_per_second": median(&single),
        "torch_codes_per_second_batch": median(&batch),
        "ratio_torch": median(&|round| Some(round.streaming / single(round)?)),
        "ratio_torch_batch": median(&|round| Some(round.streaming / batch(round)?)),
        "ratio_torch_windows_batch": median(&|round| Some(round.by_window / batch(round)?)),
        // Distances from the codes of the float network: rms of the int8 codes in quantisation levels, and
        // largest difference of PyTorch's codes relative to the largest value.
        "int8_rms_steps": int8_rms_levels,
        "torch_relative": torch_relative,
        "arch": env::consts::ARCH,
        "threads": 1,
        "rounds": rounds.len(),
        "torch": version,
    });
    let next = "compare tests/bench/torch_encoder.py with the mode and the network in signal/model/artifact/model.toml";
    Report::new("host", figures, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn synthetic(with_torch: bool, torch_relative: f64) -> Report {
        // The last round is ten times slower, as on a busy PC.
        let rounds = [1.0, 1.1, 0.1].map(|speed| Round {
            streaming: 8_000.0 * speed,
            by_window: 4_000.0 * speed,
            pipeline: 7_000.0 * speed,
            torch: with_torch.then(|| Answer {
                version: "2".to_owned(),
                codes: Vec::new(),
                single: 1_000.0 * speed,
                batch: 5_000.0 * speed,
            }),
        });
        report(&rounds, 0.5, with_torch.then_some(torch_relative)).expect("a report")
    }

    #[test]
    fn a_ratio_is_that_of_a_round_and_a_slow_round_does_not_count() {
        let report = synthetic(true, 1e-7);
        for (name, value) in [
            ("codes_per_second", 8_000.0),
            ("codes_per_second_windows", 4_000.0),
            ("codes_per_second_pipeline", 7_000.0),
            ("torch_codes_per_second", 1_000.0),
            ("ratio_torch", 8.0),
            ("ratio_torch_batch", 1.6),
            ("ratio_torch_windows_batch", 0.8),
        ] {
            assert_eq!(report.object[name], value, "{name}");
        }
        assert_eq!(report.faults(), [""; 0]);
    }

    #[test]
    fn without_torch_its_figures_are_null_and_other_codes_are_a_fault_whatever_the_speed() {
        let report = synthetic(false, 0.0);
        let json = &report.object;
        assert!(json["codes_per_second"].is_f64());
        assert!(json["ratio_torch"].is_null() && json["torch_relative"].is_null());
        assert_eq!(report.faults(), [""; 0]);
        synthetic(true, 0.1).assert_only_fault("torch_relative is 0.1;");
    }
}
