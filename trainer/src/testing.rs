//! Small data for the tests of this crate.

use crate::dataset::Dataset;
use crate::parameters::Parameters;
use crate::track::Step;
use crate::{calibrate, card};
use artifact::{Artifact, CODE, Description, ELECTRODES, WINDOW_ELECTRODES};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Orthonormal directions without a decomposition: one feature each, spread over the window.
pub(crate) fn directions() -> Vec<Vec<f32>> {
    (0..CODE)
        .map(|index| {
            let mut direction = vec![0.0; WINDOW_ELECTRODES];
            direction[index * WINDOW_ELECTRODES / CODE] = 1.0;
            direction
        })
        .collect()
}

/// A few smooth sources that all electrodes see, and a little noise.
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
    Dataset::of(vec![steps])
}

/// The paper's chain at the standard deviation of the real training set.
pub(crate) fn description() -> Description {
    let mut description = card::description();
    description.input.sd_uv = 47.3;
    description
}

/// A calibrated model of given parameters.
pub(crate) fn artifact(parameters: &Parameters) -> Artifact {
    calibrate::artifact(description(), parameters, &dataset(1, 64)).unwrap()
}
