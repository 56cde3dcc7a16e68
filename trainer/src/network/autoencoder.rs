//! The layers of the autoencoder with their parameters, and the forward pass of a group.

use super::group::Group;
use super::layout::Layout;
use crate::layers::batch_norm::{BatchNorm, Moments};
use crate::layers::convolution::Layer;
use crate::layers::linear::Matrix;
use crate::layers::pool::{Pooled, max_pool, unpool};
use crate::layers::volume::Volume;
use crate::layers::{LANES, Lanes};
use crate::parameters::Parameters;
use artifact::Mode;

/// The autoencoder with its parameters. A layer's name is that of its tensors.
#[derive(Debug)]
pub(super) struct Autoencoder<'a> {
    pub(super) layout: &'a Layout,
    parameters: &'a Parameters,
}

/// A code, and what its decoder takes besides it in mode `paper`.
#[derive(Clone, Debug)]
pub(super) struct Encoded {
    pub(super) pooled: Pooled,
    pub(super) code: Vec<Lanes>,
}

/// Output of the decoder's first convolution, and its input.
#[derive(Clone, Debug)]
pub(super) struct Expanded {
    pub(super) unpooled: Volume,
    /// Output of the ReLU.
    pub(super) hidden: Volume,
}

impl<'a> Autoencoder<'a> {
    pub(super) fn new(layout: &'a Layout, parameters: &'a Parameters) -> Self {
        Self { layout, parameters }
    }

    pub(super) fn mode(&self) -> Mode {
        self.parameters.mode()
    }

    /// Returns a convolution by its name.
    pub(super) fn layer(&self, name: &str) -> Layer<'a> {
        Layer {
            weight: self.parameters.values(&format!("{name}.weight")),
            bias: self.parameters.values(&format!("{name}.bias")),
            pads: self.layout.geometry.padding.pads(),
        }
    }

    /// Returns the matrix of a fully connected layer by its name.
    pub(super) fn matrix(&self, name: &str) -> Matrix<'a> {
        let dimensions = self.layout.geometry.dimensions;
        let (numbers, window) = (dimensions.numbers, dimensions.window_electrodes());
        let (outputs, inputs) = match name {
            "encoder.fc" => (numbers, self.layout.geometry.flat()),
            "encoder.shortcut" => (numbers, window),
            "decoder.fc" => (self.layout.geometry.flat(), numbers),
            _ => (window, numbers),
        };
        Matrix {
            values: self.parameters.values(&format!("{name}.weight")),
            outputs,
            inputs,
        }
    }

    /// Returns a batch norm by its name, with the statistics of a batch.
    pub(super) fn norm(&self, name: &str, moments: &Moments) -> BatchNorm<'a> {
        BatchNorm::new(self.gain_offset(name), moments.mean(), &moments.variance())
    }

    /// Returns a batch norm by its name, with the running statistics.
    fn running_norm(&self, name: &str) -> BatchNorm<'a> {
        let statistic = |part| self.parameters.values(&format!("{name}.running_{part}"));
        BatchNorm::new(
            self.gain_offset(name),
            statistic("mean").to_vec(),
            statistic("var"),
        )
    }

    fn gain_offset(&self, name: &str) -> [&'a [f32]; 2] {
        ["weight", "bias"].map(|part| self.parameters.values(&format!("{name}.{part}")))
    }

    /// Returns code and reconstructed electrodes of a group; batch norm uses the running statistics.
    pub(super) fn reconstruct(&self, group: &Group) -> (Vec<Lanes>, Vec<Lanes>) {
        if !self.mode().has_convolutions() {
            let code = self.project(group);
            let window = self.decode(&code);
            return (code, window);
        }
        let x = self.running_norm("encoder.norm1").apply(&self.first(group));
        let x = self.running_norm("encoder.norm2").apply(&self.second(&x));
        let encoded = self.encode(group, &x);
        let window = self.decode_running(&encoded.code, Some(&encoded.pooled));
        (encoded.code, window)
    }

    /// Returns the electrodes that a code decodes to; batch norm uses the running statistics.
    pub(super) fn decode(&self, code: &[Lanes]) -> Vec<Lanes> {
        if self.mode().has_convolutions() {
            return self.decode_running(code, None);
        }
        let decoder = self.matrix("decoder.shortcut");
        let mut window = vec![[0.0; LANES]; decoder.outputs];
        decoder.multiply(code, &mut window);
        window
    }

    fn decode_running(&self, code: &[Lanes], pooled: Option<&Pooled>) -> Vec<Lanes> {
        let x = self.expand(code, pooled).hidden;
        self.window(&self.running_norm("decoder.norm1").apply(&x), code)
    }

    /// Returns the code of a group, and the largest activation of each convolution times the factor of the batch
    /// norm after it; batch norm uses the running statistics.
    pub(super) fn trace(&self, group: &Group) -> (Vec<Lanes>, [f32; 2]) {
        if !self.mode().has_convolutions() {
            return (self.project(group), [0.0; 2]);
        }
        let norms = ["encoder.norm1", "encoder.norm2"].map(|name| self.running_norm(name));
        let first = self.first(group);
        let second = self.second(&norms[0].apply(&first));
        let activations = [(&norms[0], &first), (&norms[1], &second)]
            .map(|(norm, x)| norm.largest_scaled(x, group.windows));
        let encoded = self.encode(group, &norms[1].apply(&second));
        (encoded.code, activations)
    }

    /// Returns the code of a group in mode `pca`.
    fn project(&self, group: &Group) -> Vec<Lanes> {
        let encoder = self.matrix("encoder.shortcut");
        let mut code = vec![[0.0; LANES]; encoder.outputs];
        encoder.multiply(&group.electrodes, &mut code);
        code
    }

    /// Returns the output of the first convolution and its ReLU.
    pub(super) fn first(&self, group: &Group) -> Volume {
        let mut x = self.layer("encoder.conv1").convolve(&group.cells);
        x.rectify();
        x
    }

    /// Returns the output of the second convolution and its ReLU.
    pub(super) fn second(&self, x: &Volume) -> Volume {
        let mut x = self.layer("encoder.conv2").convolve(x);
        x.rectify();
        x
    }

    /// Returns the code from the normalised output of the second convolution.
    pub(super) fn encode(&self, group: &Group, x: &Volume) -> Encoded {
        let pooled = max_pool(x, &self.layout.geometry);
        let bias = self.parameters.values("encoder.fc.bias");
        let mut code: Vec<Lanes> = bias.iter().map(|bias| [*bias; LANES]).collect();
        self.matrix("encoder.fc")
            .multiply(&pooled.values, &mut code);
        if self.mode().has_shortcut() {
            let shortcut = self.matrix("encoder.shortcut");
            shortcut.multiply(&group.electrodes, &mut code);
        }
        Encoded { pooled, code }
    }

    /// Returns the output of the decoder's first convolution. In mode `paper`, the places of the encoder's maxima
    /// come with the pools.
    pub(super) fn expand(&self, code: &[Lanes], pooled: Option<&Pooled>) -> Expanded {
        let geometry = &self.layout.geometry;
        let bias = self.parameters.values("decoder.fc.bias");
        let mut flat: Vec<Lanes> = bias.iter().map(|bias| [*bias; LANES]).collect();
        self.matrix("decoder.fc").multiply(code, &mut flat);
        let unpooled = if self.mode() == Mode::Paper {
            let pooled =
                pooled.expect("the encoder's pools, without which mode paper does not decode");
            pooled.scatter(&flat, geometry)
        } else {
            unpool(&flat, geometry)
        };
        let mut hidden = self.layer("decoder.conv1").convolve_transposed(&unpooled);
        hidden.rectify();
        Expanded { unpooled, hidden }
    }

    /// Returns the reconstructed electrodes from the normalised output of the decoder's first convolution.
    pub(super) fn window(&self, x: &Volume, code: &[Lanes]) -> Vec<Lanes> {
        let cells = self.layer("decoder.conv2").convolve_transposed(x);
        let mut window = self.layout.gather(&cells);
        if self.mode().has_shortcut() {
            self.matrix("decoder.shortcut").multiply(code, &mut window);
        }
        window
    }
}
