//! Small models and datasets for the tests of this crate.

use crate::calibrate::calibrated_artifact;
use crate::card;
use crate::dataset::Dataset;
use crate::parameters::Parameters;
use crate::track::Step;
use artifact::{Artifact, CODE, Description, ELECTRODES, WINDOW_ELECTRODES};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Returns orthonormal directions. Each selects a single feature, and the selected features are spread
/// evenly over the window.
pub(crate) fn directions() -> Vec<Vec<f32>> {
    (0..CODE)
        .map(|index| {
            let mut direction = vec![0.0; WINDOW_ELECTRODES];
            direction[index * WINDOW_ELECTRODES / CODE] = 1.0;
            direction
        })
        .collect()
}

/// Returns a dataset of a few low-pass-filtered sources shared by all electrodes, plus a little noise.
pub(crate) fn dataset(seed: u64, steps: usize) -> Dataset {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sources = [0.0_f32; 4];
    let steps = (0..steps)
        .map(|_| -> Step {
            for source in &mut sources {
                *source = 0.9 * *source + rng.random_range(-0.7..0.7);
            }
            std::array::from_fn(|electrode| {
                let own = sources[electrode % 4] + 0.5 * sources[electrode / 16];
                own + rng.random_range(-0.05..0.05)
            })
        })
        .collect();
    debug_assert!(ELECTRODES.div_ceil(16) == sources.len());
    Dataset::from_segments(vec![steps])
}

/// Returns the description of the paper's chain with a realistic standard deviation of the input,
/// 47.3 uV.
pub(crate) fn description() -> Description {
    let mut description = card::description();
    description.input.sd_uv = 47.3;
    description
}

/// Returns a calibrated model with the given parameters.
pub(crate) fn artifact(parameters: &Parameters) -> Artifact {
    calibrated_artifact(description(), parameters, &dataset(1, 64)).unwrap()
}
