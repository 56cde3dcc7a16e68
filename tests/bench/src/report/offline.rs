//! The benchmark `offline`: `host-sim encode` and `host-sim decode` on one core, in multiples of real time,
//! beside scipy and PyTorch doing the same.

mod ours;
mod torch;

use serde_json::json;

use self::ours::Ours;
use self::torch::{Answer, Torch};
use super::checked_in;
use super::figures::Report;

/// Number of rounds; each times every contender once. One more round at the start is a warm-up and is not
/// counted.
const ROUNDS: usize = 5;

/// Seconds that the contenders took in one round.
#[derive(Debug)]
struct Round {
    encode_s: f64,
    decode_s: f64,
    /// scipy and PyTorch, where they are installed.
    torch: Option<Answer>,
}

/// Times both contenders alternately on `seconds` of synthetic EEG, and compares the errors of what they
/// decode.
///
/// # Errors
/// A contender does not run.
pub(crate) fn measure(seconds: u32) -> anyhow::Result<Report> {
    let artifact = checked_in::artifact()?;
    let ours = Ours::new(seconds)?;
    let torch = Torch::find();
    eprintln!("encoding and decoding {seconds} s of signal, {ROUNDS} times each");
    let mut rounds = Vec::new();
    for _ in 0..=ROUNDS {
        rounds.push(Round {
            encode_s: ours.encode()?,
            decode_s: ours.decode()?,
            torch: torch
                .as_ref()
                .map(|torch| torch.run(ours.folder(), &artifact.description))
                .transpose()?,
        });
    }
    let prd_percent = ours.prd_percent()?;
    let torch_prd_percent = torch.map(|_| ours.torch_prd_percent()).transpose()?;
    report(
        &rounds[1..],
        seconds,
        [Some(prd_percent), torch_prd_percent],
    )
}

/// Returns the report, with medians over the rounds. A ratio is the median of the rounds' ratios, because
/// other load of the PC slows both contenders of a round equally. No speed has a limit, because it depends on
/// the PC.
fn report(
    rounds: &[Round],
    seconds: u32,
    [prd_percent, torch_prd_percent]: [Option<f64>; 2],
) -> anyhow::Result<Report> {
    let median = |figure: &dyn Fn(&Round) -> Option<f64>| {
        let mut figures: Vec<f64> = rounds.iter().map(figure).collect::<Option<_>>()?;
        figures.sort_by(f64::total_cmp);
        figures.get(figures.len() / 2).copied()
    };
    let times = |took_s: f64| f64::from(seconds) / took_s;
    let versions = rounds[0].torch.as_ref();
    let figures = json!({
        "encode_times_real_time": median(&|round| Some(times(round.encode_s))),
        "decode_times_real_time": median(&|round| Some(times(round.decode_s))),
        "torch_encode_times_real_time": median(&|round| Some(times(round.torch.as_ref()?.encode_s))),
        "torch_decode_times_real_time": median(&|round| Some(times(round.torch.as_ref()?.decode_s))),
        "encode_ratio_torch": median(&|round| Some(round.torch.as_ref()?.encode_s / round.encode_s)),
        "decode_ratio_torch": median(&|round| Some(round.torch.as_ref()?.decode_s / round.decode_s)),
        "prd_percent": prd_percent,
        "torch_prd_percent": torch_prd_percent,
        "electrodes": model::ELECTRODES,
        "rate_hz": model::ADC_RATE_HZ,
        "seconds": seconds,
        "threads": 1,
        "rounds": rounds.len(),
        "torch": versions.map(|answer| &answer.torch),
        "scipy": versions.map(|answer| &answer.scipy),
    });
    let next = "compare tests/bench/offline_torch.py with docs/decoding.md and signal/model/artifact/model.toml";
    Report::new("offline", figures, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_multiples_of_real_time_and_ratios_those_of_a_round() {
        // The last round is ten times slower, as on a busy PC.
        let rounds = [1.0, 1.1, 10.0].map(|slowness| Round {
            encode_s: 0.5 * slowness,
            decode_s: 2.0 * slowness,
            torch: Some(Answer {
                torch: "2".to_owned(),
                scipy: "1".to_owned(),
                encode_s: 1.0 * slowness,
                decode_s: 8.0 * slowness,
            }),
        });
        let report = report(&rounds, 110, [Some(13.5), Some(5.0)]).expect("a report");
        for (name, value) in [
            ("encode_times_real_time", 200.0),
            ("decode_times_real_time", 50.0),
            ("encode_ratio_torch", 2.0),
            ("decode_ratio_torch", 4.0),
        ] {
            let found = report.object[name].as_f64().expect("a number");
            assert!((found - value).abs() < 1e-6, "{name}: {found}");
        }
        assert_eq!(report.faults(), [""; 0]);
    }
}
