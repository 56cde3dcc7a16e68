//! The benchmark `training`: updates of the autoencoder on one thread, beside PyTorch doing the same.
//!
//! Both start from the built-in model's weights and see the same batches, so the losses after each update also
//! show that both compute the same gradients and updates.

mod ours;
mod round;
mod torch;

use serde_json::json;

use self::ours::Ours;
use self::round::{BATCH, Round, UPDATES};
use self::torch::Torch;
use super::checked_in;
use super::figures::Report;

/// Number of rounds; each times every contender once.
const ROUNDS: usize = 5;
/// A round of the trainer, and one of PyTorch where it is installed.
type Pair = (Round, Option<Round>);

/// Times both contenders alternately.
///
/// # Errors
/// A contender does not run, or the built-in model has no convolutions.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let artifact = checked_in::artifact()?;
    let ours = Ours::new(&artifact)?;
    let torch = Torch::find();
    eprintln!("training on {UPDATES} batches of {BATCH} windows, {ROUNDS} times each");
    let mut rounds: Vec<Pair> = Vec::new();
    for _ in 0..ROUNDS {
        let own = ours.train();
        let theirs = torch
            .as_ref()
            .map(|torch| torch.train(ours.folder(), &artifact.description))
            .transpose()?;
        rounds.push((own, theirs));
    }
    report(&rounds)
}

/// Returns the report, with medians over the rounds. The ratio is the median of the rounds' ratios, because
/// other load of the PC slows both contenders of a round equally. No speed has a limit, because it depends on
/// the PC.
fn report(rounds: &[Pair]) -> anyhow::Result<Report> {
    let median = |figure: &dyn Fn(&Pair) -> Option<f64>| {
        let mut figures: Vec<f64> = rounds.iter().map(figure).collect::<Option<_>>()?;
        figures.sort_by(f64::total_cmp);
        figures.get(figures.len() / 2).copied()
    };
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let speed = |seconds: f64| (UPDATES * BATCH) as f64 / seconds;
    let (own, theirs) = &rounds[0];
    let difference = theirs.as_ref().map(|theirs| {
        let pairs = own.losses.iter().zip(&theirs.losses);
        pairs.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs() / b))
    });
    let figures = json!({
        "windows_per_second": median(&|(own, _)| Some(speed(own.seconds))),
        "torch_windows_per_second": median(&|(_, theirs)| Some(speed(theirs.as_ref()?.seconds))),
        "ratio_torch": median(&|(own, theirs)| Some(theirs.as_ref()?.seconds / own.seconds)),
        "loss_first": own.losses.first(),
        "loss_last": own.losses.last(),
        "loss_difference_torch": difference,
        "batch": BATCH,
        "updates": UPDATES,
        "rounds": rounds.len(),
        "threads": 1,
        "torch": theirs.as_ref().and_then(|theirs| theirs.version.clone()),
    });
    let next = "compare tests/bench/training_torch.py with trainer/src/network/backward.rs";
    Report::new("training", figures, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(seconds: f64, losses: [f64; 2]) -> Round {
        Round {
            seconds,
            losses: losses.to_vec(),
            version: None,
        }
    }

    #[test]
    fn the_ratio_is_that_of_a_round_and_the_difference_the_largest() {
        // The last round is ten times slower, as on a busy PC.
        let rounds = [1.0, 1.1, 10.0].map(|slowness| {
            let theirs = round(1.5 * slowness, [2.0, 1.0001]);
            (round(slowness, [2.0, 1.0]), Some(theirs))
        });
        let report = report(&rounds).expect("a report");
        let figure = |name: &str| report.object[name].as_f64().expect("a number");
        assert!((figure("ratio_torch") - 1.5).abs() < 1e-9);
        assert!((figure("windows_per_second") - 640.0 / 1.1).abs() < 1e-6);
        assert!((figure("loss_difference_torch") - 1e-4).abs() < 1e-7);
        assert_eq!(report.faults(), [""; 0]);
    }
}
