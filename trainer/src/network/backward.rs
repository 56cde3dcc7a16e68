//! Forward and backward pass of a batch, whose groups are computed in parallel.
//!
//! Batch norm needs the whole batch, so each pass consists of stages. Between two stages the
//! statistics of all groups are added, in the order of the groups.

use super::autoencoder::{Autoencoder, Encoded, Expanded, of_batch};
use super::group::Group;
use crate::layers::batch_norm::{BatchNorm, Moments, NormGradient};
use crate::layers::linear::matrix_gradient;
use crate::layers::pool::unpool_gradient;
use crate::layers::{LANES, Lanes, Volume, total};
use crate::parameters::{Layer, Norm, TENSORS, Weights};
use artifact::{CONV1_CHANNELS, CONV2_CHANNELS, Mode};
use packed_fit::in_parallel;

/// Loss and gradients of one batch.
#[derive(Debug)]
pub struct BatchGradients {
    /// Mean squared error over the electrodes of the batch.
    pub loss: f64,
    /// Gradients of the loss with respect to all parameters; empty for running statistics, which
    /// are not trained.
    pub gradients: Weights,
}

/// Activations of one group that the backward pass needs. `first`, `second` and `hidden` are
/// outputs of a ReLU and inputs of a batch norm.
struct Activations {
    first: Volume,
    normalised: Volume,
    second: Volume,
    encoded: Encoded,
    expanded: Expanded,
}

/// Result of a stage of the backward pass for one group: gradients of parameters, and the gradient
/// from which the next stage starts.
struct Stage {
    gradients: Weights,
    norm: NormGradient,
    /// Gradient at the output of the batch norm from which the next stage starts.
    output: Volume,
}

/// Computes loss and gradients of a batch. Also returns the batch statistics of the three batch
/// norms, the encoder's two first.
pub(super) fn gradients(
    autoencoder: &Autoencoder<'_>,
    groups: &[Group],
) -> (BatchGradients, [Moments; 3]) {
    let Weights { encoder, decoder } = autoencoder.weights;
    let first = each(groups.len(), |at| autoencoder.first(&groups[at]));
    let moments1 = moments(groups, |at| &first[at]);
    let norm1 = of_batch(&encoder.norm1, &moments1);
    let second = each(groups.len(), |at| {
        let normalised = norm1.apply(&first[at]);
        let second = autoencoder.second(&normalised);
        (normalised, second)
    });
    let moments2 = moments(groups, |at| &second[at].1);
    let norm2 = of_batch(&encoder.norm2, &moments2);
    let expanded = each(groups.len(), |at| {
        let encoded = autoencoder.encode(&groups[at], &norm2.apply(&second[at].1));
        let expanded = autoencoder.expand(&encoded.code, Some(&encoded.pooled));
        (encoded, expanded)
    });
    let moments3 = moments(groups, |at| &expanded[at].1.hidden);
    let norm3 = of_batch(&decoder.norm1, &moments3);
    let activations: Vec<Activations> = first
        .into_iter()
        .zip(second)
        .zip(expanded)
        .map(|((first, (normalised, second)), (encoded, expanded))| Activations {
            first,
            normalised,
            second,
            encoded,
            expanded,
        })
        .collect();
    let pass = Backward {
        autoencoder,
        groups,
        activations: &activations,
        windows: groups.iter().map(|group| group.windows).sum(),
    };
    let (loss, gradients) = pass.run([&norm1, &norm2, &norm3]);
    let statistics = [moments1, moments2, moments3];
    (BatchGradients { loss, gradients }, statistics)
}

/// Calls `f` with the index of each group, in parallel.
fn each<R: Send>(groups: usize, f: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let indices: Vec<usize> = (0..groups).collect();
    in_parallel::map(&indices, |&at| f(at))
}

/// Returns the moments of each channel of a volume, over the windows of all groups.
fn moments<'a>(groups: &[Group], volume: impl Fn(usize) -> &'a Volume + Sync) -> Moments {
    let moments = each(groups.len(), |at| Moments::new(volume(at), groups[at].windows));
    let (first, rest) = moments.split_first().expect("a batch has windows");
    rest.iter().fold(first.clone(), Moments::merge)
}

/// The inputs of the backward pass of a batch: network, windows and activations.
struct Backward<'a> {
    autoencoder: &'a Autoencoder<'a>,
    groups: &'a [Group],
    activations: &'a [Activations],
    /// Number of windows of the batch.
    windows: usize,
}

impl Backward<'_> {
    fn run(&self, [norm1, norm2, norm3]: [&BatchNorm<'_>; 3]) -> (f64, Weights) {
        let mut all = Weights::default();
        let stages = each(self.groups.len(), |at| self.output_stage(at, norm3));
        let (losses, stages): (Vec<f64>, Vec<_>) = stages.into_iter().unzip();
        let (stages, codes): (Vec<Stage>, Vec<Vec<Lanes>>) = stages.into_iter().unzip();
        let total = add_stages(&mut all, &stages);
        all.decoder.norm1 = total.clone().into();
        let stages = each(stages.len(), |at| {
            let hidden = &self.activations[at].expanded.hidden;
            let gradient = self.through(norm3, hidden, stages[at].output.clone(), &total, at);
            self.code_stage(at, &gradient, &codes[at], norm2)
        });
        let total = add_stages(&mut all, &stages);
        all.encoder.norm2 = total.clone().into();
        let stages = each(stages.len(), |at| {
            let second = &self.activations[at].second;
            let gradient = self.through(norm2, second, stages[at].output.clone(), &total, at);
            self.second_stage(at, &gradient, norm1)
        });
        let total = add_stages(&mut all, &stages);
        all.encoder.norm1 = total.clone().into();
        let encoder = &self.autoencoder.weights.encoder;
        let gradients = each(stages.len(), |at| {
            let first = &self.activations[at].first;
            let gradient = self.through(norm1, first, stages[at].output.clone(), &total, at);
            let layer = self.autoencoder.convolution(&encoder.conv1);
            let mut gradients = Weights::default();
            gradients.encoder.conv1 = layer.parameter_gradient(&self.groups[at].cells, &gradient);
            gradients
        });
        for gradients in &gradients {
            add(&mut all, gradients);
        }
        (losses.iter().sum(), all)
    }

    /// Returns the gradient at the input of a ReLU, from `gradient` at the output of the batch norm
    /// that follows the ReLU.
    fn through(
        &self,
        norm: &BatchNorm<'_>,
        x: &Volume,
        gradient: Volume,
        total: &NormGradient,
        at: usize,
    ) -> Volume {
        let values = (x.places() * self.windows) as f64;
        let windows = self.groups[at].windows;
        let mut gradient = norm.input_gradient(x, gradient, total, values, windows);
        gradient.rectify_gradient(x);
        gradient
    }

    /// Computes the loss and the gradients of the decoder's last layers. Also returns the gradient
    /// at the code through the shortcut.
    fn output_stage(&self, at: usize, norm: &BatchNorm<'_>) -> (f64, (Stage, Vec<Lanes>)) {
        let (group, activations) = (&self.groups[at], &self.activations[at]);
        let code = &activations.encoded.code;
        let hidden = &activations.expanded.hidden;
        let normalised = norm.apply(hidden);
        let mut window = self.autoencoder.window(&normalised, code);
        let count = (self.windows * window.len()) as f64;
        let loss = group.squared_error(&window) / count;
        #[expect(clippy::cast_possible_truncation, reason = "gradients are f32")]
        let factor = (2.0 / count) as f32;
        for (y, x) in window.iter_mut().zip(&group.electrodes) {
            for lane in 0..LANES {
                y[lane] = if lane < group.windows { factor * (y[lane] - x[lane]) } else { 0.0 };
            }
        }
        let mut gradients = Weights::default();
        let mut at_code = vec![[0.0; LANES]; code.len()];
        if let Some(shortcut) = self.autoencoder.decoder_shortcut() {
            gradients.decoder.shortcut.weight = matrix_gradient(code, &window);
            shortcut.multiply_transposed(&window, &mut at_code);
        }
        let cells = self.autoencoder.layout.scatter(&window);
        let decoder = &self.autoencoder.weights.decoder;
        let layer = self.autoencoder.convolution(&decoder.conv2);
        gradients.decoder.conv2 = layer.transposed_parameter_gradient(&normalised, &cells);
        let output = layer.convolve_transposed_gradient(CONV1_CHANNELS, &cells);
        let norm = norm.parameter_gradient(hidden, &output);
        let stage = Stage { gradients, norm, output };
        (loss, (stage, at_code))
    }

    /// Backward pass from the decoder's first convolution to the encoder's second batch norm.
    fn code_stage(
        &self,
        at: usize,
        gradient: &Volume,
        at_code: &[Lanes],
        norm: &BatchNorm<'_>,
    ) -> Stage {
        let (group, activations) = (&self.groups[at], &self.activations[at]);
        let geometry = &self.autoencoder.layout.geometry;
        let Encoded { pooled, code } = &activations.encoded;
        let mut gradients = Weights::default();
        let Weights { encoder, decoder } = &mut gradients;
        let conv1 = &self.autoencoder.weights.decoder.conv1;
        let layer = self.autoencoder.convolution(conv1);
        let unpooled = &activations.expanded.unpooled;
        decoder.conv1 = layer.transposed_parameter_gradient(unpooled, gradient);
        let gradient = layer.convolve_transposed_gradient(CONV2_CHANNELS, gradient);
        let flat = if self.autoencoder.mode == Mode::Paper {
            pooled.gather(&gradient)
        } else {
            unpool_gradient(&gradient, geometry)
        };
        decoder.fc = linear_gradient(code, &flat);
        let mut at_code = at_code.to_vec();
        self.autoencoder.decoder_fc().multiply_transposed(&flat, &mut at_code);
        if self.autoencoder.mode.has_shortcut() {
            encoder.shortcut.weight = matrix_gradient(&group.electrodes, &at_code);
        }
        encoder.fc = linear_gradient(&pooled.values, &at_code);
        let mut flat = vec![[0.0; LANES]; geometry.flat()];
        self.autoencoder.encoder_fc().multiply_transposed(&at_code, &mut flat);
        let output = pooled.scatter(&flat, geometry);
        Stage { gradients, norm: norm.parameter_gradient(&activations.second, &output), output }
    }

    /// Backward pass from the encoder's second convolution to its first batch norm.
    fn second_stage(&self, at: usize, gradient: &Volume, norm: &BatchNorm<'_>) -> Stage {
        let activations = &self.activations[at];
        let encoder = &self.autoencoder.weights.encoder;
        let layer = self.autoencoder.convolution(&encoder.conv2);
        let mut gradients = Weights::default();
        gradients.encoder.conv2 = layer.parameter_gradient(&activations.normalised, gradient);
        let output = layer.convolve_gradient(CONV1_CHANNELS, gradient);
        Stage { gradients, norm: norm.parameter_gradient(&activations.first, &output), output }
    }
}

/// Adds the gradients of all groups to `all`, and returns the sum of their batch-norm gradients.
fn add_stages(all: &mut Weights, stages: &[Stage]) -> NormGradient {
    for stage in stages {
        add(all, &stage.gradients);
    }
    let (first, rest) = stages.split_first().expect("a batch has windows");
    rest.iter().fold(first.norm.clone(), |sum, stage| sum.add(&stage.norm))
}

/// Adds `gradients` to `all`, tensor by tensor.
fn add(all: &mut Weights, gradients: &Weights) {
    for tensor in TENSORS {
        let (sums, values) = (tensor.of_mut(all), tensor.of(gradients));
        if sums.is_empty() {
            sums.extend(values);
        } else {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += value;
            }
        }
    }
}

/// Returns the gradient of a fully connected layer from its input and the gradient at its output.
fn linear_gradient(x: &[Lanes], gradient: &[Lanes]) -> Layer {
    Layer { weight: matrix_gradient(x, gradient), bias: gradient.iter().map(total).collect() }
}

impl From<NormGradient> for Norm {
    fn from(gradient: NormGradient) -> Self {
        let [weight, bias] = gradient.to_numbers();
        Self { weight, bias, ..Self::default() }
    }
}
