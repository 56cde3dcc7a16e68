//! The encoder in f32: computes the code of a window on the scalp grid.

use crate::convolution::{Convolution, Dense, Norm, Volume, add_product, read_shortcut};
use crate::error::ArtifactError;
use crate::folder::Artifact;
use crate::geometry::{CONV1_CHANNELS, CONV2_CHANNELS, Geometry};
use crate::scalp_grid::ScalpGrid;
use crate::tensors::Tensors;

/// The encoder in f32: two convolutions, each with ReLU and batch norm, a max-pool and a fully
/// connected layer. A linear shortcut is added to their output if the mode has one. The integer
/// encoder's quantisation error is measured against this encoder. In mode `packed`, codes are
/// empty.
#[derive(Clone, Debug)]
pub struct FloatEncoder {
    geometry: Geometry,
    grid: ScalpGrid,
    convolutions: Option<Convolutions>,
    /// Weights of the shortcut, `[number][step][electrode]`; `None` if the mode has no shortcut.
    shortcut: Option<Vec<f32>>,
}

#[derive(Clone, Debug)]
struct Convolutions {
    conv1: Convolution,
    norm1: Norm,
    conv2: Convolution,
    norm2: Norm,
    fc: Dense,
}

/// A code, and the largest activations that occur while it is computed, for calibration.
#[derive(Clone, Debug)]
pub struct TracedCode {
    /// The code as floats, before quantisation.
    pub code: Vec<f32>,
    /// Largest |g| * relu(conv1), where g = norm1.weight / sqrt(variance + 1e-5); 0 if there is no
    /// conv1.
    pub activation1_max: f32,
    /// Largest |g| * relu(conv2), where g = norm2.weight / sqrt(variance + 1e-5); 0 if there is no
    /// conv2.
    pub activation2_max: f32,
}

impl FloatEncoder {
    /// Builds the encoder of an artifact.
    ///
    /// # Errors
    /// If the artifact's tensors do not fit its mode; impossible after [`Artifact::read`].
    pub fn new(artifact: &Artifact) -> Result<Self, ArtifactError> {
        let description = &artifact.description;
        let geometry = Geometry::new(description);
        let numbers = geometry.dimensions.numbers;
        let window = geometry.dimensions.window_electrodes();
        let has_convolutions = description.mode.has_convolutions();
        let convolutions =
            has_convolutions.then(|| Convolutions::read(&artifact.weights, &geometry));
        Ok(Self {
            geometry,
            grid: ScalpGrid::new(description),
            convolutions: convolutions.transpose()?,
            shortcut: read_shortcut(artifact, "encoder.shortcut.weight", [numbers, window])?,
        })
    }

    /// Returns the code of a window. The window is `[step][row][column]`, in units of `input.sd_uv`
    /// microvolts.
    ///
    /// # Panics
    /// If `window` does not have the length of the model's windows.
    pub fn encode(&self, window: &[f32]) -> Vec<f32> {
        self.encode_traced(window).code
    }

    /// Returns the code of a window and the largest activations, which calibration needs.
    ///
    /// # Panics
    /// If `window` does not have the length of the model's windows.
    pub fn encode_traced(&self, window: &[f32]) -> TracedCode {
        let dimensions = &self.geometry.dimensions;
        assert_eq!(window.len(), dimensions.window_cells(), "cells of a window");
        let mut traced = TracedCode {
            code: vec![0.0; dimensions.numbers],
            activation1_max: 0.0,
            activation2_max: 0.0,
        };
        if let Some(convolutions) = &self.convolutions {
            convolutions.encode(window, &self.geometry, &mut traced);
        }
        if let Some(shortcut) = &self.shortcut {
            add_product(&mut traced.code, shortcut, &self.grid.gather(window));
        }
        traced
    }
}

impl Convolutions {
    fn read(weights: &Tensors, geometry: &Geometry) -> Result<Self, ArtifactError> {
        let [first, second] = [
            ("encoder.conv1", [CONV1_CHANNELS, 1]),
            ("encoder.conv2", [CONV2_CHANNELS, CONV1_CHANNELS]),
        ]
        .map(|(name, shape)| Convolution::read(weights, name, shape, shape[0]));
        let fc_shape = [geometry.dimensions.numbers, geometry.flat()];
        Ok(Self {
            conv1: first?,
            norm1: Norm::read(weights, "encoder.norm1", CONV1_CHANNELS)?,
            conv2: second?,
            norm2: Norm::read(weights, "encoder.norm2", CONV2_CHANNELS)?,
            fc: Dense::read(weights, "encoder.fc", fc_shape)?,
        })
    }

    fn encode(&self, window: &[f32], geometry: &Geometry, traced: &mut TracedCode) {
        let dimensions = &geometry.dimensions;
        let x = Volume {
            channels: 1,
            size: [dimensions.steps, dimensions.rows, dimensions.columns],
            values: window.to_vec(),
        };
        let pads = geometry.padding.pads();
        let mut x = self.conv1.forward(&x.padded(pads));
        x.relu();
        traced.activation1_max = self.norm1.largest_scaled(&x);
        self.norm1.apply(&mut x);
        let mut x = self.conv2.forward(&x.padded(pads));
        x.relu();
        traced.activation2_max = self.norm2.largest_scaled(&x);
        self.norm2.apply(&mut x);
        traced.code = self.fc.forward(&max_pool(&x, geometry));
    }
}

/// Returns the maximum of each pool of `x`; positions that do not fill a pool are dropped.
fn max_pool(x: &Volume, geometry: &Geometry) -> Vec<f32> {
    let ([_, rows, columns], pool) = (x.size, geometry.pool);
    let mut pooled = Vec::with_capacity(geometry.flat());
    for channel in 0..x.channels {
        let values = x.channel(channel);
        for step in 0..geometry.pooled[0] {
            for row in 0..geometry.pooled[1] {
                for column in 0..geometry.pooled[2] {
                    let mut largest = f32::NEG_INFINITY;
                    for t in step * pool[0]..(step + 1) * pool[0] {
                        for r in row * pool[1]..(row + 1) * pool[1] {
                            let start = (t * rows + r) * columns + column * pool[2];
                            let block = &values[start..start + pool[2]];
                            largest = block.iter().copied().fold(largest, f32::max);
                        }
                    }
                    pooled.push(largest);
                }
            }
        }
    }
    pooled
}
