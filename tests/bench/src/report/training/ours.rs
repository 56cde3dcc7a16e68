//! The trainer's updates, timed in this process.

use std::fs;
use std::path::Path;

use anyhow::ensure;
use artifact::{Artifact, Dimensions, Geometry};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::time::{ClockId, clock_gettime};
use tempfile::TempDir;
use trainer::adam::Adam;
use trainer::network::Network;
use trainer::parameters::Parameters;

use super::round::{BATCH, RATE, Round, UPDATES, WARM_UP};

/// The network with its initial parameters, and the batches.
pub(crate) struct Ours {
    network: Network,
    parameters: Parameters,
    windows: Vec<Vec<f32>>,
    folder: TempDir,
}

impl Ours {
    /// Draws the windows, and writes them for Python.
    pub(crate) fn new(artifact: &Artifact) -> anyhow::Result<Self> {
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

    /// Returns the folder with the windows.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Trains on all batches. The time is that of the processor, over all threads.
    pub(crate) fn train(&self) -> Round {
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

/// Returns windows of a few low-pass-filtered sources shared by all electrodes, plus noise of each electrode.
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

/// Returns the processor time of this process, seconds.
#[expect(clippy::cast_precision_loss, reason = "nanoseconds of minutes")]
fn processor_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}
