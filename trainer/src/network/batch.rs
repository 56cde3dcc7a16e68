//! Forward and backward pass of a batch, whose groups are computed in parallel.
//!
//! Batch norm needs the whole batch, so each pass consists of stages, between which the statistics of the
//! groups are added, always in their order.

use super::autoencoder::{Autoencoder, Encoded, Expanded};
use super::group::Group;
use crate::adam::Gradients;
use crate::in_parallel;
use crate::layers::batch_norm::{BatchNorm, Moments, NormGradient};
use crate::layers::convolution::LayerGradient;
use crate::layers::linear::matrix_gradient;
use crate::layers::pool::unpool_gradient;
use crate::layers::volume::Volume;
use crate::layers::{LANES, Lanes, total};
use artifact::{CONV1_CHANNELS, CONV2_CHANNELS, Mode};

/// Loss and gradients of one batch.
#[derive(Debug)]
pub struct BatchGradients {
    /// Mean squared error over the electrodes of the batch.
    pub loss: f64,
    /// Gradients of the loss with respect to all parameters except the running statistics.
    pub gradients: Gradients,
}

/// Activations of one group that the backward pass needs. `first`, `second` and `hidden` are outputs of a
/// ReLU, and inputs of a batch norm.
struct Activations {
    first: Volume,
    normalised: Volume,
    second: Volume,
    encoded: Encoded,
    expanded: Expanded,
}

/// Gradients of one group, and the gradient that the next stage continues with.
struct Stage {
    gradients: Gradients,
    norm: NormGradient,
    /// Gradient at the output of the batch norm.
    output: Volume,
}

/// Computes loss and gradients of a batch. Returns them, and the statistics of each batch norm by name.
pub(super) fn gradients(
    autoencoder: &Autoencoder<'_>,
    groups: &[Group],
) -> (BatchGradients, [(&'static str, Moments); 3]) {
    let first = each(groups.len(), |at| autoencoder.first(&groups[at]));
    let moments1 = moments(groups, |at| &first[at]);
    let norm1 = autoencoder.norm("encoder.norm1", &moments1);
    let second = each(groups.len(), |at| {
        let normalised = norm1.apply(&first[at]);
        let second = autoencoder.second(&normalised);
        (normalised, second)
    });
    let moments2 = moments(groups, |at| &second[at].1);
    let norm2 = autoencoder.norm("encoder.norm2", &moments2);
    let expanded = each(groups.len(), |at| {
        let encoded = autoencoder.encode(&groups[at], &norm2.apply(&second[at].1));
        let expanded = autoencoder.expand(&encoded.code, Some(&encoded.pooled));
        (encoded, expanded)
    });
    let moments3 = moments(groups, |at| &expanded[at].1.hidden);
    let norm3 = autoencoder.norm("decoder.norm1", &moments3);
    let activations: Vec<Activations> = first
        .into_iter()
        .zip(second)
        .zip(expanded)
        .map(
            |((first, (normalised, second)), (encoded, expanded))| Activations {
                first,
                normalised,
                second,
                encoded,
                expanded,
            },
        )
        .collect();
    let pass = Backward {
        autoencoder,
        groups,
        activations: &activations,
        windows: groups.iter().map(|group| group.windows).sum(),
    };
    let (loss, gradients) = pass.run([&norm1, &norm2, &norm3]);
    let statistics = [
        ("encoder.norm1", moments1),
        ("encoder.norm2", moments2),
        ("decoder.norm1", moments3),
    ];
    (BatchGradients { loss, gradients }, statistics)
}

/// Calls `f` with the index of each group, in parallel.
fn each<R: Send>(groups: usize, f: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let indices: Vec<usize> = (0..groups).collect();
    in_parallel::map(&indices, |&at| f(at))
}

/// Returns the moments of a volume over all groups.
fn moments<'a>(groups: &[Group], volume: impl Fn(usize) -> &'a Volume + Sync) -> Moments {
    let moments = each(groups.len(), |at| {
        Moments::new(volume(at), groups[at].windows)
    });
    let (first, rest) = moments.split_first().expect("a batch has windows");
    rest.iter().fold(first.clone(), Moments::merge)
}

/// The backward pass of a batch.
struct Backward<'a> {
    autoencoder: &'a Autoencoder<'a>,
    groups: &'a [Group],
    activations: &'a [Activations],
    /// Number of windows of the batch.
    windows: usize,
}

impl Backward<'_> {
    fn run(&self, [norm1, norm2, norm3]: [&BatchNorm<'_>; 3]) -> (f64, Gradients) {
        let mut all = Gradients::new();
        let stages = each(self.groups.len(), |at| self.output_stage(at, norm3));
        let (losses, stages): (Vec<f64>, Vec<_>) = stages.into_iter().unzip();
        let (stages, codes): (Vec<Stage>, Vec<Vec<Lanes>>) = stages.into_iter().unzip();
        let total = add_stage(
            &mut all,
            &stages,
            "decoder.norm1.weight",
            "decoder.norm1.bias",
        );
        let stages = each(stages.len(), |at| {
            let hidden = &self.activations[at].expanded.hidden;
            let gradient = self.through(norm3, hidden, stages[at].output.clone(), &total, at);
            self.code_stage(at, &gradient, &codes[at], norm2)
        });
        let total = add_stage(
            &mut all,
            &stages,
            "encoder.norm2.weight",
            "encoder.norm2.bias",
        );
        let stages = each(stages.len(), |at| {
            let second = &self.activations[at].second;
            let gradient = self.through(norm2, second, stages[at].output.clone(), &total, at);
            self.second_stage(at, &gradient, norm1)
        });
        let total = add_stage(
            &mut all,
            &stages,
            "encoder.norm1.weight",
            "encoder.norm1.bias",
        );
        let stages = each(stages.len(), |at| {
            let first = &self.activations[at].first;
            let gradient = self.through(norm1, first, stages[at].output.clone(), &total, at);
            let layer = self.autoencoder.layer("encoder.conv1");
            layer.parameter_gradient(&self.groups[at].cells, &gradient)
        });
        for gradient in stages {
            add_layer(
                &mut all,
                ["encoder.conv1.weight", "encoder.conv1.bias"],
                gradient,
            );
        }
        (losses.iter().sum(), all)
    }

    /// Returns the gradient before a batch norm and the ReLU ahead of it.
    fn through(
        &self,
        norm: &BatchNorm<'_>,
        x: &Volume,
        gradient: Volume,
        total: &NormGradient,
        at: usize,
    ) -> Volume {
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 values")]
        let values = (x.places() * self.windows) as f64;
        let windows = self.groups[at].windows;
        let mut gradient = norm.input_gradient(x, gradient, total, values, windows);
        gradient.rectify_gradient(x);
        gradient
    }

    /// Computes the loss and the gradients of the decoder's output; also returns the part of the gradient at
    /// the code that comes through the shortcut.
    fn output_stage(&self, at: usize, norm: &BatchNorm<'_>) -> (f64, (Stage, Vec<Lanes>)) {
        let (group, activations) = (&self.groups[at], &self.activations[at]);
        let code = &activations.encoded.code;
        let hidden = &activations.expanded.hidden;
        let normalised = norm.apply(hidden);
        let mut window = self.autoencoder.window(&normalised, code);
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 numbers")]
        let count = (self.windows * window.len()) as f64;
        let loss = group.squared_error(&window) / count;
        #[expect(clippy::cast_possible_truncation, reason = "gradients are f32")]
        let factor = (2.0 / count) as f32;
        for (y, x) in window.iter_mut().zip(&group.electrodes) {
            for lane in 0..LANES {
                y[lane] = if lane < group.windows {
                    factor * (y[lane] - x[lane])
                } else {
                    0.0
                };
            }
        }
        let mut gradients = Gradients::new();
        let mut at_code = vec![[0.0; LANES]; code.len()];
        if self.autoencoder.mode().has_shortcut() {
            gradients.insert("decoder.shortcut.weight", matrix_gradient(code, &window));
            let shortcut = self.autoencoder.matrix("decoder.shortcut");
            shortcut.multiply_transposed(&window, &mut at_code);
        }
        let cells = self.autoencoder.layout.scatter(&window);
        let layer = self.autoencoder.layer("decoder.conv2");
        let gradient = layer.transposed_parameter_gradient(&normalised, &cells);
        add_layer(
            &mut gradients,
            ["decoder.conv2.weight", "decoder.conv2.bias"],
            gradient,
        );
        let output = layer.convolve_transposed_gradient(CONV1_CHANNELS, &cells);
        let norm = norm.parameter_gradient(hidden, &output);
        let stage = Stage {
            gradients,
            norm,
            output,
        };
        (loss, (stage, at_code))
    }

    /// Continues from the decoder's first convolution to the encoder's second batch norm.
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
        let mut gradients = Gradients::new();
        let layer = self.autoencoder.layer("decoder.conv1");
        let unpooled = &activations.expanded.unpooled;
        let of_layer = layer.transposed_parameter_gradient(unpooled, gradient);
        add_layer(
            &mut gradients,
            ["decoder.conv1.weight", "decoder.conv1.bias"],
            of_layer,
        );
        let gradient = layer.convolve_transposed_gradient(CONV2_CHANNELS, gradient);
        let flat = if self.autoencoder.mode() == Mode::Paper {
            pooled.gather(&gradient)
        } else {
            unpool_gradient(&gradient, geometry)
        };
        gradients.insert("decoder.fc.weight", matrix_gradient(code, &flat));
        gradients.insert("decoder.fc.bias", flat.iter().map(total).collect());
        let mut at_code = at_code.to_vec();
        let decoder = self.autoencoder.matrix("decoder.fc");
        decoder.multiply_transposed(&flat, &mut at_code);
        if self.autoencoder.mode().has_shortcut() {
            let gradient = matrix_gradient(&group.electrodes, &at_code);
            gradients.insert("encoder.shortcut.weight", gradient);
        }
        gradients.insert(
            "encoder.fc.weight",
            matrix_gradient(&pooled.values, &at_code),
        );
        gradients.insert("encoder.fc.bias", at_code.iter().map(total).collect());
        let mut flat = vec![[0.0; LANES]; geometry.flat()];
        let encoder = self.autoencoder.matrix("encoder.fc");
        encoder.multiply_transposed(&at_code, &mut flat);
        let output = pooled.scatter(&flat, geometry);
        Stage {
            gradients,
            norm: norm.parameter_gradient(&activations.second, &output),
            output,
        }
    }

    /// Continues from the encoder's second convolution to its first batch norm.
    fn second_stage(&self, at: usize, gradient: &Volume, norm: &BatchNorm<'_>) -> Stage {
        let activations = &self.activations[at];
        let layer = self.autoencoder.layer("encoder.conv2");
        let mut gradients = Gradients::new();
        let of_layer = layer.parameter_gradient(&activations.normalised, gradient);
        add_layer(
            &mut gradients,
            ["encoder.conv2.weight", "encoder.conv2.bias"],
            of_layer,
        );
        let output = layer.convolve_gradient(CONV1_CHANNELS, gradient);
        Stage {
            gradients,
            norm: norm.parameter_gradient(&activations.first, &output),
            output,
        }
    }
}

/// Adds the gradients of all groups to `all`, and returns the gradients of the batch norm over all groups.
fn add_stage(
    all: &mut Gradients,
    stages: &[Stage],
    gain: &'static str,
    offset: &'static str,
) -> NormGradient {
    for stage in stages {
        for (name, gradient) in &stage.gradients {
            add(all, name, gradient.clone());
        }
    }
    let (first, rest) = stages.split_first().expect("a batch has windows");
    let total = rest
        .iter()
        .fold(first.norm.clone(), |sum, stage| sum.add(&stage.norm));
    let [of_gain, of_offset] = total.to_numbers();
    add(all, gain, of_gain);
    add(all, offset, of_offset);
    total
}

/// Adds the gradients of a convolution's kernels and bias.
fn add_layer(all: &mut Gradients, [weight, bias]: [&'static str; 2], gradient: LayerGradient) {
    add(all, weight, gradient.weight);
    add(all, bias, gradient.bias);
}

/// Adds a gradient to that of the same tensor.
fn add(all: &mut Gradients, name: &'static str, gradient: Vec<f32>) {
    match all.get_mut(name) {
        None => {
            all.insert(name, gradient);
        }
        Some(sums) => {
            for (sum, value) in sums.iter_mut().zip(gradient) {
                *sum += value;
            }
        }
    }
}
