//! The benchmark `training`: times the trainer's updates of the autoencoder on one thread, and
//! PyTorch's.
//!
//! Both contenders start from the built-in model's weights and see the same batches. Equal losses
//! after each update therefore show that they compute the same gradients and updates.

use std::ffi::OsString;
use std::fs;

use anyhow::ensure;
use artifact::{Artifact, Dimensions, Geometry};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::time::{ClockId, clock_gettime};
use serde::Deserialize;
use serde_json::json;
use tempfile::TempDir;
use trainer::adam::Adam;
use trainer::network::Network;
use trainer::parameters::Parameters;

use super::checked_in;
use super::figures::{Report, median};
use super::programs::{self, Python};

/// Number of windows in a training batch.
const BATCH: usize = 32;
/// Number of updates that are timed in a round, after those that warm up.
const UPDATES: usize = 20;
/// Number of updates at the start of a round that only warm up and are not timed.
const WARM_UP: usize = 2;
/// Learning rate of every update.
const RATE: f64 = 1e-3;

/// Time and losses of one contender in one round.
#[derive(Debug, Clone, Deserialize)]
struct Round {
    /// Processor time of the timed updates, seconds.
    seconds: f64,
    /// For each batch, including those of the warm-up, its mean squared error before its update.
    losses: Vec<f64>,
    /// Version of PyTorch; `None` for the trainer.
    #[serde(default)]
    version: Option<String>,
}

/// Number of rounds, each of which times every contender (the trainer, PyTorch) once.
const ROUNDS: usize = 5;
/// One round's results: of the trainer, and of PyTorch where it is installed.
type Pair = (Round, Option<Round>);

/// Times the trainer and PyTorch alternately.
///
/// # Errors
/// A contender does not run, or the built-in model has no convolutions or no shortcut.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let artifact = checked_in::artifact()?;
    let ours = Ours::new(&artifact)?;
    let request = json!({
        "model": programs::model(&artifact.description),
        "batch": BATCH,
        "warm_up": WARM_UP,
        "rate": RATE,
    });
    let arguments = [
        ours.folder.path().into(),
        OsString::from(request.to_string()),
    ];
    let torch = Python::find_torch("numpy");
    eprintln!("training on {UPDATES} batches of {BATCH} windows, {ROUNDS} times each");
    let mut rounds: Vec<Pair> = Vec::new();
    for _ in 0..ROUNDS {
        let own = ours.train();
        let theirs = torch
            .map(|torch| torch.answer("training_torch.py", &arguments, &[]))
            .transpose()?;
        rounds.push((own, theirs));
    }
    report(&rounds)
}

/// Builds the report; each speed is a median over the rounds.
fn report(rounds: &[Pair]) -> anyhow::Result<Report> {
    let median = |figure: &dyn Fn(&Pair) -> Option<f64>| median(rounds, figure);
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

/// The trainer's network with its initial parameters, and the training windows.
struct Ours {
    network: Network,
    parameters: Parameters,
    windows: Vec<Vec<f32>>,
    folder: TempDir,
}

impl Ours {
    /// Draws the training windows, and writes them to a file for Python.
    fn new(artifact: &Artifact) -> anyhow::Result<Self> {
        let description = &artifact.description;
        ensure!(
            description.mode.has_convolutions() && description.mode.has_shortcut(),
            "the built-in model has no convolutions or no shortcut, so there is nothing to compare\n  \
             next: build with a model of mode shortcut"
        );
        let windows = windows(description.dimensions());
        let folder = tempfile::tempdir()?;
        let bytes = windows
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes());
        fs::write(
            folder.path().join("windows.f32"),
            bytes.collect::<Vec<u8>>(),
        )?;
        let geometry = Geometry::new(description);
        Ok(Self {
            network: Network::new(description),
            parameters: Parameters::from_tensors(description.mode, geometry, &artifact.weights)?,
            windows,
            folder,
        })
    }

    /// Trains on all batches. The measured time is processor time, summed over all threads.
    fn train(&self) -> Round {
        let mut parameters = self.parameters.clone();
        let mut adam = Adam::new(&parameters);
        let mut losses = Vec::new();
        let mut start = processor_s();
        for (at, batch) in self.windows.chunks(BATCH).enumerate() {
            if at == WARM_UP {
                start = processor_s();
            }
            let windows: Vec<&[f32]> = batch.iter().map(Vec::as_slice).collect();
            let batch = self.network.gradients(&mut parameters, &windows);
            adam.update(&mut parameters, &batch.gradients, RATE);
            losses.push(batch.loss);
        }
        Round {
            seconds: processor_s() - start,
            losses,
            version: None,
        }
    }
}

/// Returns random windows: every electrode has a mix of a few low-pass-filtered sources, plus noise
/// of its own.
fn windows(dimensions: Dimensions) -> Vec<Vec<f32>> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut sources = [0.0_f32; 8];
    let mut window = || -> Vec<f32> {
        let steps = 0..dimensions.steps;
        let values = steps.flat_map(|_| -> Vec<f32> {
            for source in &mut sources {
                *source = 0.9 * *source + rng.random_range(-0.7..0.7);
            }
            let electrodes = 0..dimensions.electrodes;
            electrodes
                .map(|at| sources[at % 8] + 0.5 * sources[at / 8 % 8] + rng.random_range(-0.2..0.2))
                .collect()
        });
        values.collect()
    };
    let count = BATCH * (WARM_UP + UPDATES);
    (0..count).map(|_| window()).collect()
}

/// Returns the processor time that this process has used, seconds.
#[expect(clippy::cast_precision_loss, reason = "nanoseconds of minutes")]
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
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
        let rounds = [(round(1.0, [2.0, 1.0]), Some(round(1.5, [2.0, 1.0001])))];
        let report = report(&rounds).expect("a report");
        let figure = |name: &str| report.object[name].as_f64().expect("a number");
        assert!((figure("ratio_torch") - 1.5).abs() < 1e-9);
        assert!((figure("windows_per_second") - 640.0).abs() < 1e-6);
        assert!((figure("loss_difference_torch") - 1e-4).abs() < 1e-7);
        assert_eq!(report.faults(), [""; 0]);
    }
}
