//! The autoencoder's layers with their parameters, and the forward pass of a group.

use super::group::{Group, Layout};
use crate::layers::batch_norm::{BatchNorm, Moments};
use crate::layers::convolution::Layer;
use crate::layers::linear::Matrix;
use crate::layers::pool::{Pooled, max_pool, unpool};
use crate::layers::{LANES, Lanes, Volume};
use crate::parameters::{self, Norm, Parameters, Weights};
use artifact::Mode;

/// Layout and parameters of the autoencoder's layers.
#[derive(Debug)]
pub(super) struct Autoencoder<'a> {
    pub(super) layout: &'a Layout,
    pub(super) mode: Mode,
    pub(super) weights: &'a Weights,
}

/// A code, and the positions of the max-pool's maxima, which the decoder needs in mode `paper`.
#[derive(Clone, Debug)]
pub(super) struct Encoded {
    pub(super) pooled: Pooled,
    pub(super) code: Vec<Lanes>,
}

/// Input and output of the decoder's first convolution.
#[derive(Clone, Debug)]
pub(super) struct Expanded {
    pub(super) unpooled: Volume,
    /// Output of the convolution after its ReLU.
    pub(super) hidden: Volume,
}

impl<'a> Autoencoder<'a> {
    pub(super) fn new(layout: &'a Layout, parameters: &'a Parameters) -> Self {
        Self { layout, mode: parameters.mode(), weights: &parameters.weights }
    }

    /// Returns a convolution or transposed convolution from its kernels and bias, with the model's
    /// padding.
    pub(super) fn convolution(&self, layer: &'a parameters::Layer) -> Layer<'a> {
        Layer {
            weight: &layer.weight,
            bias: &layer.bias,
            pads: self.layout.geometry.padding.pads(),
        }
    }

    pub(super) fn encoder_fc(&self) -> Matrix<'a> {
        Matrix::new(&self.weights.encoder.fc.weight, self.layout.geometry.flat())
    }

    pub(super) fn decoder_fc(&self) -> Matrix<'a> {
        Matrix::new(&self.weights.decoder.fc.weight, self.numbers())
    }

    /// Returns the linear map from a window to its code; `None` if the mode has none.
    pub(super) fn encoder_shortcut(&self) -> Option<Matrix<'a>> {
        let window = self.layout.geometry.dimensions.window_electrodes();
        let weight = &self.weights.encoder.shortcut.weight;
        let has_shortcut = self.mode.has_shortcut();
        has_shortcut.then(|| Matrix::new(weight, window))
    }

    /// Returns the linear map from a code to its window; `None` if the mode has none.
    pub(super) fn decoder_shortcut(&self) -> Option<Matrix<'a>> {
        let weight = &self.weights.decoder.shortcut.weight;
        let has_shortcut = self.mode.has_shortcut();
        has_shortcut.then(|| Matrix::new(weight, self.numbers()))
    }

    fn numbers(&self) -> usize {
        self.layout.geometry.dimensions.numbers
    }

    /// Returns the codes of a group and the electrode values decoded from them; batch norm uses the
    /// running statistics.
    pub(super) fn reconstruct(&self, group: &Group) -> (Vec<Lanes>, Vec<Lanes>) {
        if !self.mode.has_convolutions() {
            let code = self.project(group);
            let window = self.decode(&code);
            return (code, window);
        }
        let encoder = &self.weights.encoder;
        let x = running(&encoder.norm1).apply(&self.first(group));
        let x = running(&encoder.norm2).apply(&self.second(&x));
        let encoded = self.encode(group, &x);
        let window = self.decode_running(&encoded.code, Some(&encoded.pooled));
        (encoded.code, window)
    }

    /// Decodes a code and returns the values of all electrodes; batch norm uses the running
    /// statistics.
    pub(super) fn decode(&self, code: &[Lanes]) -> Vec<Lanes> {
        if self.mode.has_convolutions() {
            return self.decode_running(code, None);
        }
        let dimensions = self.layout.geometry.dimensions;
        let mut window = vec![[0.0; LANES]; dimensions.window_electrodes()];
        if let Some(shortcut) = self.decoder_shortcut() {
            shortcut.multiply(code, &mut window);
        }
        window
    }

    fn decode_running(&self, code: &[Lanes], pooled: Option<&Pooled>) -> Vec<Lanes> {
        let x = self.expand(code, pooled).hidden;
        self.window(&running(&self.weights.decoder.norm1).apply(&x), code)
    }

    /// Returns the code of a group, and for each convolution the largest activation times the
    /// factor of the batch norm after it; batch norm uses the running statistics.
    pub(super) fn trace(&self, group: &Group) -> (Vec<Lanes>, [f32; 2]) {
        if !self.mode.has_convolutions() {
            return (self.project(group), [0.0; 2]);
        }
        let encoder = &self.weights.encoder;
        let norms = [running(&encoder.norm1), running(&encoder.norm2)];
        let first = self.first(group);
        let second = self.second(&norms[0].apply(&first));
        let activations = [(&norms[0], &first), (&norms[1], &second)]
            .map(|(norm, x)| norm.largest_scaled(x, group.windows));
        let encoded = self.encode(group, &norms[1].apply(&second));
        (encoded.code, activations)
    }

    /// Returns the code of a group in mode `pca`.
    fn project(&self, group: &Group) -> Vec<Lanes> {
        let mut code = vec![[0.0; LANES]; self.numbers()];
        if let Some(shortcut) = self.encoder_shortcut() {
            shortcut.multiply(&group.electrodes, &mut code);
        }
        code
    }

    /// Returns the output of the encoder's first convolution and its ReLU.
    pub(super) fn first(&self, group: &Group) -> Volume {
        let mut x = self.convolution(&self.weights.encoder.conv1).convolve(&group.cells);
        x.rectify();
        x
    }

    /// Returns the output of the encoder's second convolution and its ReLU.
    pub(super) fn second(&self, x: &Volume) -> Volume {
        let mut x = self.convolution(&self.weights.encoder.conv2).convolve(x);
        x.rectify();
        x
    }

    /// Returns the code from `x`, the output of the second convolution after its batch norm.
    pub(super) fn encode(&self, group: &Group, x: &Volume) -> Encoded {
        let pooled = max_pool(x, &self.layout.geometry);
        let bias = self.weights.encoder.fc.bias.iter();
        let mut code: Vec<Lanes> = bias.map(|bias| [*bias; LANES]).collect();
        self.encoder_fc().multiply(&pooled.values, &mut code);
        if let Some(shortcut) = self.encoder_shortcut() {
            shortcut.multiply(&group.electrodes, &mut code);
        }
        Encoded { pooled, code }
    }

    /// Returns input and output of the decoder's first convolution. In mode `paper`, `pooled` holds
    /// the positions of the encoder's maxima.
    pub(super) fn expand(&self, code: &[Lanes], pooled: Option<&Pooled>) -> Expanded {
        let geometry = &self.layout.geometry;
        let decoder = &self.weights.decoder;
        let bias = decoder.fc.bias.iter();
        let mut flat: Vec<Lanes> = bias.map(|bias| [*bias; LANES]).collect();
        self.decoder_fc().multiply(code, &mut flat);
        let unpooled = if self.mode == Mode::Paper {
            let pooled =
                pooled.expect("the encoder's pools, without which mode paper does not decode");
            pooled.scatter(&flat, geometry)
        } else {
            unpool(&flat, geometry)
        };
        let mut hidden = self.convolution(&decoder.conv1).convolve_transposed(&unpooled);
        hidden.rectify();
        Expanded { unpooled, hidden }
    }

    /// Returns the reconstructed electrode values from `x`, the output of the decoder's first
    /// convolution after its batch norm.
    pub(super) fn window(&self, x: &Volume, code: &[Lanes]) -> Vec<Lanes> {
        let layer = self.convolution(&self.weights.decoder.conv2);
        let mut window = self.layout.gather(&layer.convolve_transposed(x));
        if let Some(shortcut) = self.decoder_shortcut() {
            shortcut.multiply(code, &mut window);
        }
        window
    }
}

/// Returns a batch norm that normalises with the statistics of the current batch.
pub(super) fn of_batch<'a>(norm: &'a Norm, moments: &Moments) -> BatchNorm<'a> {
    let parameters = [norm.weight.as_slice(), &norm.bias];
    BatchNorm::new(parameters, moments.mean(), &moments.variance())
}

/// Returns a batch norm that normalises with the running statistics.
fn running(norm: &Norm) -> BatchNorm<'_> {
    let parameters = [norm.weight.as_slice(), &norm.bias];
    BatchNorm::new(parameters, norm.running_mean.clone(), &norm.running_var)
}
