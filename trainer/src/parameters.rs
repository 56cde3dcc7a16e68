//! The network's numbers by name, as the artifact has them.

use crate::pool::GEOMETRY;
use artifact::{ArtifactError, CODE, Mode, Tensors, WINDOW_ELECTRODES, weight_shapes};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// The network's numbers by name; last dimension fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    mode: Mode,
    values: BTreeMap<&'static str, Vec<f32>>,
}

impl Parameters {
    /// The start of a training in mode `shortcut`: the shortcut is the projection onto
    /// `directions` and back, everything else is random but for the two layers through which the
    /// convolutions reach code and window; these are 0.
    ///
    /// # Panics
    /// When there are not 128 directions of 976 elements.
    pub fn from_directions(directions: &[Vec<f32>], seed: u64) -> Self {
        let mut parameters = Self::linear(Mode::Shortcut, directions);
        for (index, (name, shape)) in weight_shapes(Mode::Shortcut, &GEOMETRY)
            .into_iter()
            .enumerate()
        {
            if name.contains("shortcut") {
                continue;
            }
            let count = shape.iter().product();
            // A stream for each tensor: no tensor's numbers depend on another's size.
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(index as u64);
            let values = match (name.rsplit_once('.'), name.contains("norm")) {
                (Some((_, "weight" | "running_var")), true) => vec![1.0; count],
                (_, true) => vec![0.0; count],
                _ if silent_at_first(name) => vec![0.0; count],
                _ => {
                    let bound = 1.0 / fan_in(name).sqrt();
                    (0..count)
                        .map(|_| rng.random_range(-bound..bound))
                        .collect()
                }
            };
            parameters.values.insert(name, values);
        }
        parameters
    }

    /// PCA alone: projection onto `directions` and back.
    ///
    /// # Panics
    /// When there are not 128 directions of 976 elements.
    pub fn pca(directions: &[Vec<f32>]) -> Self {
        Self::linear(Mode::Pca, directions)
    }

    fn linear(mode: Mode, directions: &[Vec<f32>]) -> Self {
        assert_eq!(
            directions.len(),
            CODE,
            "one direction for each number of the code"
        );
        let encoder = directions.concat();
        assert_eq!(
            encoder.len(),
            CODE * WINDOW_ELECTRODES,
            "one element for each feature"
        );
        let decoder = (0..WINDOW_ELECTRODES)
            .flat_map(|feature| directions.iter().map(move |direction| direction[feature]))
            .collect();
        let values = BTreeMap::from([
            ("encoder.shortcut.weight", encoder),
            ("decoder.shortcut.weight", decoder),
        ]);
        Self { mode, values }
    }

    /// The numbers of an artifact's weights.
    ///
    /// # Errors
    /// When a tensor of the mode is missing or misshapen.
    pub fn from_tensors(mode: Mode, weights: &Tensors) -> Result<Self, ArtifactError> {
        let values = weight_shapes(mode, &GEOMETRY)
            .into_iter()
            .map(|(name, shape)| Ok((name, weights.tensor(name, &shape)?.to_vec())))
            .collect::<Result<_, ArtifactError>>()?;
        Ok(Self { mode, values })
    }

    /// The weights of an artifact.
    pub fn to_tensors(&self) -> Tensors {
        let mut weights = Tensors::for_weights();
        for (name, shape) in weight_shapes(self.mode, &GEOMETRY) {
            weights.insert(name, &shape, self.values[name].clone());
        }
        weights
    }

    /// Which parts the network has.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Names and numbers.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &[f32])> {
        self.values
            .iter()
            .map(|(&name, values)| (name, values.as_slice()))
    }

    /// The numbers of a tensor.
    ///
    /// # Panics
    /// When the mode has no tensor of this name.
    pub fn values_mut(&mut self, name: &str) -> &mut [f32] {
        self.values
            .get_mut(name)
            .unwrap_or_else(|| panic!("the mode has no tensor {name}"))
    }
}

/// Whether a tensor is a running statistic, which no gradient changes.
pub fn is_statistic(name: &str) -> bool {
    name.contains(".running_")
}

/// A tensor's learning rate over that of the others. The shortcut starts at the best linear code,
/// and Adam's steps do not shrink near an optimum: at the full rate they cost more there than the
/// convolutions gain.
pub fn rate_factor(name: &str) -> f32 {
    if name.contains(".shortcut.") {
        0.01
    } else {
        1.0
    }
}

/// The layers that are 0 at the start, so that the convolutions contribute nothing. Their
/// gradients are not 0, since what they read is not.
fn silent_at_first(name: &str) -> bool {
    name.starts_with("encoder.fc.") || name.starts_with("decoder.conv2.")
}

/// Inputs of one output, as PyTorch counts them for its uniform start within 1 / sqrt(inputs).
fn fan_in(name: &str) -> f32 {
    match name.rsplit_once('.') {
        Some(("encoder.conv1" | "decoder.conv2", _)) => 27.0,
        Some(("encoder.conv2" | "decoder.conv1", _)) => 16.0 * 27.0,
        Some(("encoder.fc", _)) => 1152.0,
        _ => 128.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn the_start_fills_every_tensor_of_the_mode_and_repeats_with_the_seed() {
        let start = Parameters::from_directions(&testing::directions(), 7);
        let tensors = start.to_tensors();
        assert_eq!(
            Parameters::from_tensors(Mode::Shortcut, &tensors).unwrap(),
            start
        );
        assert_eq!(
            start,
            Parameters::from_directions(&testing::directions(), 7)
        );
        assert_ne!(
            start,
            Parameters::from_directions(&testing::directions(), 8)
        );
    }

    #[test]
    fn random_layers_stay_within_their_bound_and_use_it() {
        let start = Parameters::from_directions(&testing::directions(), 7);
        let largest = |name: &str| {
            start.values[name]
                .iter()
                .fold(0.0, |largest: f32, value| largest.max(value.abs()))
        };
        for (name, bound) in [
            ("encoder.conv1.weight", 0.192_450_09),
            ("decoder.fc.weight", 0.088_388_35),
        ] {
            assert!(
                largest(name) <= bound && largest(name) > 0.95 * bound,
                "{name}"
            );
        }
        assert!(largest("encoder.fc.weight") == 0.0 && largest("decoder.conv2.weight") == 0.0);
    }
}
