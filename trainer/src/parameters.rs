//! The parameters of the network, keyed by the artifact's tensor names.

use artifact::{
    ArtifactError, CONV1_CHANNELS, Geometry, KERNEL, Mode, NORM_EPSILON, Tensors, weight_shapes,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// Values of all tensors of a network by the artifact's tensor names, last dimension fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    mode: Mode,
    geometry: Geometry,
    values: BTreeMap<&'static str, Vec<f32>>,
}

impl Parameters {
    /// Returns the initial parameters of a training run in mode `shortcut`.
    ///
    /// The shortcut is the projection onto `directions` and back. `encoder.fc` and `decoder.conv2`, the
    /// last layers of the convolutional encoder and decoder, are 0, and batch norm starts with factor 1
    /// and offset 0. All other layers are random.
    ///
    /// # Panics
    /// Unless there is a direction for each number of the code, with an element for each value of a
    /// window.
    pub fn from_directions(geometry: Geometry, directions: &[Vec<f32>], seed: u64) -> Self {
        let mut parameters = Self::linear(Mode::Shortcut, geometry, directions);
        parameters.draw_convolutions(seed);
        parameters
    }

    /// Returns the initial parameters of a training run without a shortcut (mode `paper-code-only`):
    /// all layers are random, and batch norm starts with factor 1 and offset 0.
    pub fn random(mode: Mode, geometry: Geometry, seed: u64) -> Self {
        let mut parameters = Self {
            mode,
            geometry,
            values: BTreeMap::new(),
        };
        parameters.draw_convolutions(seed);
        parameters
    }

    /// Draws the initial values of all tensors except those of the shortcut.
    fn draw_convolutions(&mut self, seed: u64) {
        let geometry = self.geometry;
        for (index, (name, shape)) in weight_shapes(self.mode, &geometry).into_iter().enumerate() {
            if name.contains("shortcut") {
                continue;
            }
            let count = shape.iter().product();
            // One random stream for each tensor, so that no tensor depends on the size of another.
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(index as u64);
            let values = match (name.rsplit_once('.'), name.contains("norm")) {
                (Some((_, "weight" | "running_var")), true) => vec![1.0; count],
                (_, true) => vec![0.0; count],
                _ if self.mode.has_shortcut() && starts_at_zero(name) => vec![0.0; count],
                _ => {
                    let bound = 1.0 / fan_in(name, &geometry).sqrt();
                    (0..count)
                        .map(|_| rng.random_range(-bound..bound))
                        .collect()
                }
            };
            self.values.insert(name, values);
        }
    }

    /// Returns the parameters of PCA: the projection onto `directions` and back.
    ///
    /// # Panics
    /// Unless there is a direction for each number of the code, with an element for each value of a
    /// window.
    pub fn pca(geometry: Geometry, directions: &[Vec<f32>]) -> Self {
        Self::linear(Mode::Pca, geometry, directions)
    }

    fn linear(mode: Mode, geometry: Geometry, directions: &[Vec<f32>]) -> Self {
        let numbers = geometry.dimensions.numbers;
        let features = geometry.dimensions.window_electrodes();
        assert_eq!(
            directions.len(),
            numbers,
            "one direction for each number of the code"
        );
        let encoder = directions.concat();
        assert_eq!(
            encoder.len(),
            numbers * features,
            "one element for each feature"
        );
        let decoder = (0..features)
            .flat_map(|feature| directions.iter().map(move |direction| direction[feature]))
            .collect();
        let values = BTreeMap::from([
            ("encoder.shortcut.weight", encoder),
            ("decoder.shortcut.weight", decoder),
        ]);
        Self {
            mode,
            geometry,
            values,
        }
    }

    /// Reads the parameters from the weights of an artifact.
    ///
    /// # Errors
    /// If a tensor of the mode is missing or has the wrong shape.
    pub fn from_tensors(
        mode: Mode,
        geometry: Geometry,
        weights: &Tensors,
    ) -> Result<Self, ArtifactError> {
        let values = weight_shapes(mode, &geometry)
            .into_iter()
            .map(|(name, shape)| Ok((name, weights.tensor(name, &shape)?.to_vec())))
            .collect::<Result<_, ArtifactError>>()?;
        Ok(Self {
            mode,
            geometry,
            values,
        })
    }

    /// Returns the parameters as weights of an artifact.
    pub fn to_tensors(&self) -> Tensors {
        let mut weights = Tensors::for_weights();
        for (name, shape) in weight_shapes(self.mode, &self.geometry) {
            weights.insert(name, &shape, self.values[name].clone());
        }
        weights
    }

    /// Returns the sizes between the layers, which determine the shapes of the tensors.
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the mode, which determines which tensors there are.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Iterates over names and values of all tensors, sorted by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &[f32])> {
        self.values
            .iter()
            .map(|(&name, values)| (name, values.as_slice()))
    }

    /// Holds the channels of batch norm whose input does not vary at the norm's bias, and returns their
    /// number.
    ///
    /// ReLU can silence a channel for good. Its variance then decays towards 0, and the norm would amplify
    /// the first window that excites the channel several hundred times, beyond the range of an int8
    /// factor. On all windows of the training set the output stays what it was.
    pub fn hold_silent_channels(&mut self) -> usize {
        let mut held = 0;
        for (weight, variance) in NORMS {
            let Some(variance) = self.values.get(variance).cloned() else {
                continue;
            };
            for (weight, variance) in self.values_mut(weight).iter_mut().zip(variance) {
                if variance < SILENT_VARIANCE {
                    *weight = 0.0;
                    held += 1;
                }
            }
        }
        held
    }

    /// Returns the values of a tensor.
    ///
    /// # Panics
    /// If the mode has no tensor of this name.
    pub fn values(&self, name: &str) -> &[f32] {
        let values = self.values.get(name);
        values.unwrap_or_else(|| panic!("the mode has no tensor {name}"))
    }

    /// Returns the values of a tensor, to change them.
    ///
    /// # Panics
    /// If the mode has no tensor of this name.
    pub fn values_mut(&mut self, name: &str) -> &mut [f32] {
        self.values
            .get_mut(name)
            .unwrap_or_else(|| panic!("the mode has no tensor {name}"))
    }
}

/// Largest variance of a silent channel: the norm's output varies by a thousandth of its weight.
const SILENT_VARIANCE: f32 = 1e-6 * NORM_EPSILON;

/// Weight and variance of each batch norm.
const NORMS: [(&str, &str); 3] = [
    ("encoder.norm1.weight", "encoder.norm1.running_var"),
    ("encoder.norm2.weight", "encoder.norm2.running_var"),
    ("decoder.norm1.weight", "decoder.norm1.running_var"),
];

/// Returns whether the tensor `name` is a running statistic of batch norm, which is not trained
/// by gradients.
pub fn is_statistic(name: &str) -> bool {
    name.contains(".running_")
}

/// Returns the factor by which the learning rate of the tensor `name` is multiplied.
pub fn rate_factor(name: &str) -> f32 {
    if name.contains(".shortcut.") {
        0.01
    } else {
        1.0
    }
}

/// Returns whether the tensor `name` starts at 0, so that the convolutions contribute nothing at first.
/// The gradients of such a tensor are not 0, because the inputs of its layer are not.
fn starts_at_zero(name: &str) -> bool {
    name.starts_with("encoder.fc.") || name.starts_with("decoder.conv2.")
}

/// Returns the fan-in of a layer as PyTorch counts it; initial values are uniform within +-1 /
/// sqrt(fan-in).
#[expect(clippy::cast_precision_loss, reason = "a few thousand inputs")]
fn fan_in(name: &str, geometry: &Geometry) -> f32 {
    const TAPS: usize = KERNEL.pow(3);
    let inputs = match name.rsplit_once('.') {
        Some(("encoder.conv1" | "decoder.conv2", _)) => TAPS,
        Some(("encoder.conv2" | "decoder.conv1", _)) => CONV1_CHANNELS * TAPS,
        Some(("encoder.fc", _)) => geometry.flat(),
        _ => geometry.dimensions.numbers,
    };
    inputs as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn the_initial_parameters_have_every_tensor_and_depend_on_the_seed_only() {
        let start = Parameters::from_directions(testing::geometry(), &testing::directions(), 7);
        let tensors = start.to_tensors();
        assert_eq!(
            Parameters::from_tensors(Mode::Shortcut, testing::geometry(), &tensors).unwrap(),
            start
        );
        assert_eq!(
            start,
            Parameters::from_directions(testing::geometry(), &testing::directions(), 7)
        );
        assert_ne!(
            start,
            Parameters::from_directions(testing::geometry(), &testing::directions(), 8)
        );
    }

    #[test]
    fn a_channel_that_never_varies_is_held_at_the_bias_of_its_norm() {
        let mut parameters =
            Parameters::from_directions(testing::geometry(), &testing::directions(), 7);
        assert_eq!(parameters.clone().hold_silent_channels(), 0);
        parameters.values_mut("encoder.norm2.running_var")[17] = 0.0;
        parameters.values_mut("encoder.norm2.bias")[17] = 0.5;
        let before = parameters.clone();
        assert_eq!(parameters.hold_silent_channels(), 1);
        parameters.values_mut("encoder.norm2.weight")[17] = 1.0;
        assert_eq!(parameters, before);
    }

    #[test]
    fn random_layers_fill_their_range() {
        let start = Parameters::from_directions(testing::geometry(), &testing::directions(), 7);
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
