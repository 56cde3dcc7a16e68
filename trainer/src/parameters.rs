//! The parameters of the network: one field per tensor, named as in the artifact.

use artifact::{ArtifactError, Geometry, Mode, NORM_EPSILON, Tensors, weight_shapes};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// One number for each element of each tensor of a network: weights, gradients or state of the
/// optimiser. The last dimension is the fastest; a tensor that the mode lacks is empty.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "layers, by their names")]
pub struct Weights {
    pub encoder: Encoder,
    pub decoder: Decoder,
}

/// The layers from a window to its code.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "layers, by their names")]
pub struct Encoder {
    pub conv1: Layer,
    pub norm1: Norm,
    pub conv2: Layer,
    pub norm2: Norm,
    pub fc: Layer,
    pub shortcut: Linear,
}

/// The layers from a code to its window.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "layers, by their names")]
pub struct Decoder {
    pub fc: Layer,
    pub conv1: Layer,
    pub norm1: Norm,
    pub conv2: Layer,
    pub shortcut: Linear,
}

/// A convolution or a fully connected layer.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "PyTorch's names")]
pub struct Layer {
    pub weight: Vec<f32>,
    pub bias: Vec<f32>,
}

/// A batch norm; each tensor has one element per channel.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "PyTorch's names")]
pub struct Norm {
    pub weight: Vec<f32>,
    pub bias: Vec<f32>,
    pub running_mean: Vec<f32>,
    pub running_var: Vec<f32>,
}

/// A matrix without a bias.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "PyTorch's name")]
pub struct Linear {
    pub weight: Vec<f32>,
}

/// A tensor of the network: its name in files, its role, and its field in [`Weights`].
#[derive(Debug)]
pub struct Tensor {
    /// Name of the tensor in the artifact and in checkpoints.
    pub name: &'static str,
    role: Role,
    get: fn(&Weights) -> &Vec<f32>,
    get_mut: fn(&mut Weights) -> &mut Vec<f32>,
}

/// Role of a tensor, which determines how it is initialised and trained.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    /// Kernels, matrix or bias of a layer other than the last.
    Layer,
    /// Kernels, matrix or bias of the last layer of encoder or decoder. If there is a shortcut, the
    /// layer starts at 0, so that the convolutions contribute nothing at first. The layer's
    /// gradients are not 0 at the start, because its inputs are not 0.
    LastLayer,
    /// Factor of a batch norm.
    Gain,
    /// Offset of a batch norm.
    Offset,
    /// Running mean of a batch norm.
    Mean,
    /// Running variance of a batch norm.
    Variance,
    /// Linear map between window and code.
    Shortcut,
}

macro_rules! tensors {
    ($($role:ident $half:ident.$layer:ident.$part:ident)*) => {
        &[$(Tensor {
            name: concat!(stringify!($half), ".", stringify!($layer), ".", stringify!($part)),
            role: Role::$role,
            get: |weights| &weights.$half.$layer.$part,
            get_mut: |weights| &mut weights.$half.$layer.$part,
        }),*]
    };
}

/// All tensors that a network can have.
pub const TENSORS: &[Tensor] = tensors! {
    Layer     encoder.conv1.weight
    Layer     encoder.conv1.bias
    Gain      encoder.norm1.weight
    Offset    encoder.norm1.bias
    Mean      encoder.norm1.running_mean
    Variance  encoder.norm1.running_var
    Layer     encoder.conv2.weight
    Layer     encoder.conv2.bias
    Gain      encoder.norm2.weight
    Offset    encoder.norm2.bias
    Mean      encoder.norm2.running_mean
    Variance  encoder.norm2.running_var
    LastLayer encoder.fc.weight
    LastLayer encoder.fc.bias
    Layer     decoder.fc.weight
    Layer     decoder.fc.bias
    Layer     decoder.conv1.weight
    Layer     decoder.conv1.bias
    Gain      decoder.norm1.weight
    Offset    decoder.norm1.bias
    Mean      decoder.norm1.running_mean
    Variance  decoder.norm1.running_var
    LastLayer decoder.conv2.weight
    LastLayer decoder.conv2.bias
    Shortcut  encoder.shortcut.weight
    Shortcut  decoder.shortcut.weight
};

impl Tensor {
    /// Returns the elements of this tensor in `weights`.
    pub fn of<'w>(&self, weights: &'w Weights) -> &'w [f32] {
        (self.get)(weights)
    }

    /// Returns the elements of this tensor in `weights` by mutable reference.
    pub fn of_mut<'w>(&self, weights: &'w mut Weights) -> &'w mut Vec<f32> {
        (self.get_mut)(weights)
    }

    /// Returns whether gradients train the tensor; this is so for all except running statistics.
    pub(crate) fn is_trained(&self) -> bool {
        !matches!(self.role, Role::Mean | Role::Variance)
    }

    /// Returns the factor by which the learning rate of the tensor is multiplied.
    pub(crate) fn rate_factor(&self) -> f32 {
        match self.role {
            Role::Shortcut => 0.01,
            _ => 1.0,
        }
    }
}

/// Returns the tensors of a mode with their shapes, in the order of the artifact.
pub(crate) fn shapes(mode: Mode, geometry: &Geometry) -> Vec<(&'static Tensor, Vec<usize>)> {
    let tensor = |(name, shape)| {
        let tensor = TENSORS.iter().find(|tensor| tensor.name == name);
        (tensor.expect("a field for each tensor of a mode"), shape)
    };
    let shapes = weight_shapes(mode, geometry);
    shapes.into_iter().map(tensor).collect()
}

/// The parameters of a network, with the mode that determines which tensors it has.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    mode: Mode,
    geometry: Geometry,
    /// The tensors of the mode; all others are empty.
    pub weights: Weights,
}

impl Parameters {
    /// Returns the initial parameters of a training run.
    ///
    /// The shortcut, if the mode has one, is the projection onto `directions` and back, which is
    /// PCA. With a shortcut, the last layers of the convolutional encoder and decoder, `encoder.fc`
    /// and `decoder.conv2`, are 0, so that the convolutions contribute nothing. All other layers
    /// are random; batch norm starts with factor 1 and offset 0.
    ///
    /// # Panics
    /// If the mode has a shortcut and `directions` does not hold one direction for each code value,
    /// with one element for each value of a window.
    pub fn initial(mode: Mode, geometry: Geometry, directions: &[Vec<f32>], seed: u64) -> Self {
        let mut weights = Weights::default();
        if mode.has_shortcut() {
            let numbers = geometry.dimensions.numbers;
            let features = geometry.dimensions.window_electrodes();
            assert_eq!(directions.len(), numbers, "one direction for each number of the code");
            let encoder = directions.concat();
            assert_eq!(encoder.len(), numbers * features, "one element for each value of a window");
            weights.encoder.shortcut.weight = encoder;
            weights.decoder.shortcut.weight = (0..features)
                .flat_map(|feature| directions.iter().map(move |direction| direction[feature]))
                .collect();
        }
        let mut parameters = Self { mode, geometry, weights };
        parameters.draw_convolutions(seed);
        parameters
    }

    /// Sets the initial values of all tensors except the shortcut's; layers get random values.
    fn draw_convolutions(&mut self, seed: u64) {
        let has_shortcut = self.mode.has_shortcut();
        // A bias follows its layer's weight in the list and takes its initial values from the same
        // range.
        let mut fan_in = 1.0_f32;
        for (index, (tensor, shape)) in shapes(self.mode, &self.geometry).into_iter().enumerate() {
            let count = shape.iter().product();
            if shape.len() > 1 {
                // Number of the layer's inputs, as PyTorch counts them. Initial values are within
                // +-1 / sqrt(fan-in).
                fan_in = shape[1..].iter().product::<usize>() as f32;
            }
            let values = match tensor.role {
                Role::Shortcut => continue,
                Role::Gain | Role::Variance => vec![1.0; count],
                Role::Offset | Role::Mean => vec![0.0; count],
                Role::LastLayer if has_shortcut => vec![0.0; count],
                Role::Layer | Role::LastLayer => {
                    // Each tensor has its own random stream, so that its values do not depend on
                    // the size of other tensors.
                    let mut rng = ChaCha8Rng::seed_from_u64(seed);
                    rng.set_stream(index as u64);
                    let bound = 1.0 / fan_in.sqrt();
                    (0..count).map(|_| rng.random_range(-bound..bound)).collect()
                }
            };
            *tensor.of_mut(&mut self.weights) = values;
        }
    }

    /// Reads the parameters from the weights of an artifact.
    ///
    /// # Errors
    /// If a tensor of the mode is missing or has the wrong shape.
    pub fn from_tensors(
        mode: Mode,
        geometry: Geometry,
        tensors: &Tensors,
    ) -> Result<Self, ArtifactError> {
        let mut weights = Weights::default();
        for (tensor, shape) in shapes(mode, &geometry) {
            *tensor.of_mut(&mut weights) = tensors.tensor(tensor.name, &shape)?.to_vec();
        }
        Ok(Self { mode, geometry, weights })
    }

    /// Returns the parameters as weights of an artifact.
    pub fn to_tensors(&self) -> Tensors {
        let mut tensors = Tensors::for_weights();
        for (tensor, shape) in shapes(self.mode, &self.geometry) {
            tensors.insert(tensor.name, &shape, tensor.of(&self.weights).to_vec());
        }
        tensors
    }

    /// Returns the mode of the network, which determines its tensors.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Finds the channels whose input to a batch norm does not vary, and sets the norm's weight for
    /// these channels to 0, which holds the norm's output at its bias. Returns the number of
    /// channels.
    ///
    /// ReLU can silence a channel for good. The channel's variance decays towards 0, and the norm
    /// would amplify the first window that excites the channel several hundred times, beyond the
    /// range of a requantisation factor. Holding the channel changes no output for training
    /// windows.
    pub fn hold_silent_channels(&mut self) -> usize {
        let Weights { encoder, decoder } = &mut self.weights;
        let mut held = 0;
        for norm in [&mut encoder.norm1, &mut encoder.norm2, &mut decoder.norm1] {
            for (weight, variance) in norm.weight.iter_mut().zip(&norm.running_var) {
                if *variance < SILENT_VARIANCE {
                    *weight = 0.0;
                    held += 1;
                }
            }
        }
        held
    }
}

/// Largest variance at which a channel counts as silent. At this variance, the norm's output varies
/// by a thousandth of the norm's weight.
const SILENT_VARIANCE: f32 = 1e-6 * NORM_EPSILON;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{self, shortcut};

    #[test]
    fn the_initial_parameters_have_every_tensor_and_depend_on_the_seed_only() {
        let tensors = shortcut(7).to_tensors();
        let read = Parameters::from_tensors(Mode::Shortcut, testing::geometry(), &tensors);
        assert_eq!(read.unwrap(), shortcut(7));
        assert_ne!(shortcut(7), shortcut(8));
        for tensor in TENSORS {
            assert!(!tensor.of(&shortcut(7).weights).is_empty(), "{}", tensor.name);
        }
    }

    #[test]
    fn a_channel_that_never_varies_is_held_at_the_bias_of_its_norm() {
        let mut parameters = shortcut(7);
        assert_eq!(parameters.clone().hold_silent_channels(), 0);
        parameters.weights.encoder.norm2.running_var[17] = 0.0;
        parameters.weights.encoder.norm2.bias[17] = 0.5;
        let before = parameters.clone();
        assert_eq!(parameters.hold_silent_channels(), 1);
        parameters.weights.encoder.norm2.weight[17] = 1.0;
        assert_eq!(parameters, before);
    }

    #[test]
    fn random_layers_fill_their_range() {
        let Weights { encoder, decoder } = shortcut(7).weights;
        let largest = |values: &[f32]| values.iter().fold(0.0_f32, |a, b| a.max(b.abs()));
        for (values, bound) in
            [(&encoder.conv1.weight, 0.192_450_09), (&decoder.fc.weight, 0.088_388_35)]
        {
            let largest = largest(values);
            assert!(largest <= bound && largest > 0.95 * bound, "{largest} {bound}");
        }
        assert!(largest(&encoder.fc.weight) == 0.0 && largest(&decoder.conv2.weight) == 0.0);
    }
}
