//! Small models and datasets for the tests of this crate.

use crate::calibrate::calibrated_artifact;
use crate::card::{self, Shape};
use crate::dataset::{Dataset, Split};
use crate::network::Network;
use crate::parameters::Parameters;
use crate::training::{EpochLosses, Settings, Training};
use artifact::{Artifact, CodeFormat, Description, Geometry, Mode, MontageFile, Padding};
use packed_fit::Track;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;

/// Returns orthonormal directions, each of which selects a single value of a window. The selected
/// values are spread evenly over the window.
pub(crate) fn directions() -> Vec<Vec<f32>> {
    (0..geometry().dimensions.numbers)
        .map(|index| {
            let mut direction = vec![0.0; geometry().dimensions.window_electrodes()];
            direction[feature(index)] = 1.0;
            direction
        })
        .collect()
}

/// Returns the index in a window of the value that direction `index` of [`directions`] selects.
pub(crate) fn feature(index: usize) -> usize {
    let dimensions = geometry().dimensions;
    index * dimensions.window_electrodes() / dimensions.numbers
}

/// Returns a dataset whose electrodes share a few low-pass-filtered sources, plus some noise.
pub(crate) fn dataset(seed: u64, steps: usize) -> Dataset {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sources = [0.0_f32; 4];
    let dimensions = geometry().dimensions;
    let values = (0..steps)
        .flat_map(|_| -> Vec<f32> {
            for source in &mut sources {
                *source = 0.9 * *source + rng.random_range(-0.7..0.7);
            }
            let electrode = |electrode: usize| {
                let own = sources[electrode % 4] + 0.5 * sources[electrode / 16 % 4];
                own + rng.random_range(-0.05..0.05)
            };
            (0..dimensions.electrodes).map(electrode).collect()
        })
        .collect();
    Dataset::from_segments(vec![values], dimensions)
}

/// Returns the description of the paper's chain with a realistic standard deviation of the input,
/// 47.3 uV.
pub(crate) fn description() -> Description {
    let shape = Shape {
        mode: Mode::Shortcut,
        numbers: 128,
        steps: 16,
        hop: 8,
        padding: Padding::None,
        format: CodeFormat::Int8,
    };
    let text = include_str!("../../files/montages/paper-61.toml");
    let montage = MontageFile::parse(Path::new("paper-61.toml"), text).unwrap();
    let mut description = card::description(&montage, shape);
    description.input.sd_uv = 47.3;
    description
}

/// Returns parameters of mode `pca` whose shortcut projects onto [`directions`].
pub(crate) fn pca() -> Parameters {
    Parameters::initial(Mode::Pca, geometry(), &directions(), 0)
}

/// Returns initial parameters of mode `shortcut` whose shortcut projects onto [`directions`].
pub(crate) fn shortcut(seed: u64) -> Parameters {
    Parameters::initial(Mode::Shortcut, geometry(), &directions(), seed)
}

/// Returns a model with `parameters`, calibrated on a dataset.
pub(crate) fn model(parameters: &Parameters, dataset: &Dataset) -> Artifact {
    calibrated_artifact(description(), parameters, dataset).unwrap()
}

/// Returns the sizes of the feature maps of the paper's network.
pub(crate) fn geometry() -> Geometry {
    Geometry::new(&description())
}

/// Settings of the training run of [`Run`], small so that tests are fast.
pub(crate) const SETTINGS: Settings = Settings { epochs: 2, batch: 8, peak_rate: 1e-3, seed: 4 };

/// The network and the data of a small training run.
pub(crate) struct Run {
    pub(crate) network: Network,
    pub(crate) split: Split,
}

impl Run {
    pub(crate) fn new() -> Self {
        Self {
            network: Network::new(&description()),
            split: Split { training: dataset(1, 16 * 24), validation: dataset(2, 16 * 8) },
        }
    }

    /// Returns the training run before its first epoch.
    pub(crate) fn start(&self) -> Training {
        let start = shortcut(SETTINGS.seed);
        Training::start(SETTINGS, start, &self.network, &self.split)
    }

    pub(crate) fn run_epoch(&self, training: &mut Training) -> EpochLosses {
        let go_on = |_| ControlFlow::Continue(());
        let report = training.run_epoch(&self.network, &self.split, go_on);
        report.unwrap()
    }
}

/// Runs a Python program and returns the JSON that it prints. Its arguments are the number of
/// electrodes, `arguments`, and the names of files with the values of `tracks`. Without numpy,
/// panics if the environment variable CORTICODE_REQUIRE_ROS is 1, and otherwise prints that `test`
/// is skipped.
pub(crate) fn numpy<'t>(
    test: &str,
    program: &str,
    arguments: &[String],
    tracks: impl Iterator<Item = &'t Track>,
) -> Option<serde_json::Value> {
    let folder = tempfile::tempdir().unwrap();
    // Use Debian's Python: another Python on the PATH can lack numpy.
    let mut python = Command::new("/usr/bin/python3");
    python.args(["-c", program, "8"]).args(arguments);
    for (index, track) in tracks.enumerate() {
        let path = folder.path().join(index.to_string());
        let values = track.values.iter().flat_map(|uv| uv.to_le_bytes());
        std::fs::write(&path, values.collect::<Vec<u8>>()).unwrap();
        python.arg(path);
    }
    let output = python.output().ok();
    let output = output.filter(|output| {
        let errors = String::from_utf8_lossy(&output.stderr);
        !errors.contains("No module named 'numpy'")
    });
    let Some(output) = output else {
        let required = std::env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
        assert!(!required, "python3-numpy is not installed");
        // The test harness would capture the output of a print macro.
        let line = format!("SKIPPED: {test} against numpy: no python3-numpy\n");
        std::io::stderr().write_all(line.as_bytes()).unwrap();
        return None;
    };
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    Some(serde_json::from_slice(&output.stdout).unwrap())
}
