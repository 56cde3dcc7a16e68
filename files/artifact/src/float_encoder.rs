//! The encoder in f32: computes the code of a window on the scalp grid.

use crate::convolution::{Convolution, Dense, Norm, Volume, add_product, read_shortcut};
use crate::error::ArtifactError;
use crate::folder::Artifact;
use crate::geometry::{CONV1_CHANNELS, CONV2_CHANNELS, Geometry};
use crate::scalp_grid::ScalpGrid;
use crate::tensors::Tensors;

/// The encoder in f32: two convolutions, each with ReLU and batch norm, a max-pool and a fully
/// connected layer; a linear shortcut is added to their output if the mode has one. The integer
/// encoder's quantisation error is measured against it. In mode `packed`, codes have no numbers.
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

/// A code, with the largest activations that occurred when it was computed, for calibration.
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
    /// If the window's length is not that of the model's window.
    pub fn encode(&self, window: &[f32]) -> Vec<f32> {
        self.encode_traced(window).code
    }

    /// Returns the code of a window and the largest activations, which calibration needs.
    ///
    /// # Panics
    /// If the window's length is not that of the model's window.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{NetworkShape, Padding};
    use crate::testing;

    #[test]
    fn the_pool_returns_the_maximum_of_each_block_and_drops_the_last_column() {
        // The values increase, so that the maximum of a pool is at its last step, row and column.
        // Each case has a position in the pooled volume and the position of its maximum in the
        // input; both are in channel 1.
        for (padding, pool, pooled_at, largest_at) in [
            (Padding::None, [2, 2, 2], [2, 1, 1], [5, 3, 3]),
            (Padding::Space, [1, 3, 2], [2, 1, 2], [2, 5, 5]),
        ] {
            let mut description = testing::description();
            description.network = NetworkShape { padding, pool };
            let geometry = Geometry::new(&description);
            let index = |[steps, rows, columns]: [usize; 3], [t, r, c]: [usize; 3]| {
                ((steps + t) * rows + r) * columns + c
            };
            let size = geometry.feature_map;
            let count = CONV2_CHANNELS * size.iter().product::<usize>();
            let x = Volume {
                channels: CONV2_CHANNELS,
                size,
                values: (0..count).map(|index| index as f32).collect(),
            };
            let pooled = max_pool(&x, &geometry);
            assert_eq!(pooled.len(), geometry.flat());
            let largest = pooled[index(geometry.pooled, pooled_at)];
            assert_eq!(largest, index(size, largest_at) as f32, "{pool:?}");
        }
    }

    #[test]
    fn pca_codes_are_inner_products_with_the_components() {
        let artifact = testing::pca();
        let encoder = FloatEncoder::new(&artifact).unwrap();
        // Component k of the test model copies value k of the window, so the code is the window's
        // first 128 values.
        let count = artifact.description.dimensions().window_electrodes();
        let electrodes: Vec<f32> = (0..count).map(|feature| feature as f32).collect();
        let code = encoder.encode(&ScalpGrid::new(&artifact.description).scatter(&electrodes));
        assert_eq!(code, electrodes[..128]);
    }

    #[test]
    fn a_constant_window_has_the_code_worked_out_by_hand() {
        // The test model has few weights: conv1 channel 0 = 0.5 + sum of 27 cells; the norms have
        // gain 2 and offset 0.25; conv2 channel 0 = 0.1 * the middle tap of channel 0; output 0 of
        // fc = 1 + pooled value 0; the shortcut is 0.
        let artifact = testing::shortcut();
        let encoder = FloatEncoder::new(&artifact).unwrap();
        let window = [1.0; 16 * 90];
        let traced = encoder.encode_traced(&window);
        let after1 = 2.0 * 27.5 + 0.25;
        let after2 = 2.0 * (0.1 * after1) + 0.25;
        assert!(
            (traced.code[0] - (after2 + 1.0)).abs() < 1e-4,
            "{}",
            traced.code[0]
        );
        assert!((traced.activation1_max - 55.0).abs() < 1e-4);
        assert!((traced.activation2_max - 0.2 * after1).abs() < 1e-4);
    }

    #[test]
    fn a_padded_corner_has_the_code_worked_out_by_hand() {
        // In the test model, number 0 of the code is 1 + pooled value 0, the corner of the feature
        // map. That value is computed from the corner of conv1's output, where the 27 taps reach 8
        // cells inside the window if steps are padded, and 12 if not. All cells are 1.
        for (padding, inside) in [(Padding::Space, 12.0), (Padding::All, 8.0)] {
            let mut description = testing::description();
            description.network = NetworkShape {
                padding,
                pool: [1, 1, 1],
            };
            let artifact = testing::shortcut_with(description);
            let encoder = FloatEncoder::new(&artifact).unwrap();
            let traced = encoder.encode_traced(&[1.0; 16 * 90]);
            let after1 = 2.0 * (inside + 0.5) + 0.25;
            let expected = 2.0 * (0.1 * after1) + 0.25 + 1.0;
            assert!((traced.code[0] - expected).abs() < 1e-4, "{padding:?}");
        }
    }
}
