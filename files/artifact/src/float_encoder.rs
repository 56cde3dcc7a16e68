//! The encoder in f32, from a window on the scalp grid to a code.

use crate::convolution::{Convolution, Norm, Volume, add_product};
use crate::error::ArtifactError;
use crate::folder::Artifact;
use crate::geometry::{CONV1_CHANNELS, CONV2_CHANNELS, Geometry};
use crate::scalp_grid::ScalpGrid;

/// The encoder in f32: two convolutions, each with ReLU and batch norm, a max-pool and a fully
/// connected layer. The linear shortcut is added to their output. In mode `packed`, which has
/// neither, codes have no numbers. Reference for the integer encoder's quantisation error.
#[derive(Clone, Debug)]
pub struct FloatEncoder {
    geometry: Geometry,
    grid: ScalpGrid,
    convolutions: Option<Convolutions>,
    /// Weights `[number][step][electrode]`. `None` without a shortcut.
    shortcut: Option<Vec<f32>>,
}

#[derive(Clone, Debug)]
struct Convolutions {
    conv1: Convolution,
    norm1: Norm,
    conv2: Convolution,
    norm2: Norm,
    /// Weights `[number][flat]`.
    fc_weight: Vec<f32>,
    fc_bias: Vec<f32>,
}

/// A code with the largest activations of its computation, which calibration needs.
#[derive(Clone, Debug)]
pub struct TracedCode {
    /// Float code, before quantisation.
    pub code: Vec<f32>,
    /// Largest |g| * relu(conv1), where g = norm1.weight / sqrt(variance + 1e-5); 0 in mode `pca`.
    pub activation1_max: f32,
    /// Largest |g| * relu(conv2), where g = norm2.weight / sqrt(variance + 1e-5); 0 in mode `pca`.
    pub activation2_max: f32,
}

impl FloatEncoder {
    /// Builds the encoder of an artifact.
    ///
    /// # Errors
    /// If the artifact's tensors do not fit its mode; impossible after [`Artifact::read`].
    pub fn new(artifact: &Artifact) -> Result<Self, ArtifactError> {
        let (mode, weights) = (artifact.description.mode, &artifact.weights);
        let geometry = Geometry::new(&artifact.description);
        let numbers = geometry.dimensions.numbers;
        let window = geometry.dimensions.window_electrodes();
        let convolutions = mode
            .has_convolutions()
            .then(|| {
                Ok::<_, ArtifactError>(Convolutions {
                    conv1: Convolution::read(
                        weights,
                        "encoder.conv1",
                        [CONV1_CHANNELS, 1],
                        CONV1_CHANNELS,
                    )?,
                    norm1: Norm::read(weights, "encoder.norm1", CONV1_CHANNELS)?,
                    conv2: Convolution::read(
                        weights,
                        "encoder.conv2",
                        [CONV2_CHANNELS, CONV1_CHANNELS],
                        CONV2_CHANNELS,
                    )?,
                    norm2: Norm::read(weights, "encoder.norm2", CONV2_CHANNELS)?,
                    fc_weight: weights
                        .tensor("encoder.fc.weight", &[numbers, geometry.flat()])?
                        .to_vec(),
                    fc_bias: weights.tensor("encoder.fc.bias", &[numbers])?.to_vec(),
                })
            })
            .transpose()?;
        let shortcut = mode
            .has_shortcut()
            .then(|| weights.tensor("encoder.shortcut.weight", &[numbers, window]))
            .transpose()?
            .map(<[f32]>::to_vec);
        Ok(Self {
            geometry,
            grid: ScalpGrid::new(&artifact.description),
            convolutions,
            shortcut,
        })
    }

    /// Returns the code of a window, which is `[step][row][column]` in units of `input.sd_uv`
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
        traced.code.copy_from_slice(&self.fc_bias);
        add_product(&mut traced.code, &self.fc_weight, &max_pool(&x, geometry));
    }
}

/// Returns the maximum of each pool; positions that do not fill a pool are dropped.
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
        let geometry = Geometry::new(&testing::description());
        let [steps, rows, columns] = geometry.feature_map;
        let mut values = vec![-1.0; CONV2_CHANNELS * steps * rows * columns];
        let at = |channel, t, r, c| ((channel * steps + t) * rows + r) * columns + c;
        values[at(3, 5, 2, 3)] = 7.0;
        values[at(3, 5, 2, 4)] = 9.0;
        let x = Volume {
            channels: CONV2_CHANNELS,
            size: geometry.feature_map,
            values,
        };
        let pooled = max_pool(&x, &geometry);
        assert_eq!(pooled.len(), geometry.flat());
        let index = ((3 * 6 + 2) * 3 + 1) * 2 + 1;
        assert_eq!(pooled[index], 7.0);
        assert_eq!(
            pooled.iter().filter(|value| **value == -1.0).count(),
            geometry.flat() - 1
        );
    }

    #[test]
    fn a_pool_may_be_longer_along_one_axis_than_along_another() {
        let mut description = testing::description();
        description.network = NetworkShape {
            padding: Padding::Space,
            pool: [1, 3, 2],
        };
        let geometry = Geometry::new(&description);
        let [steps, rows, columns] = geometry.feature_map;
        let count = CONV2_CHANNELS * steps * rows * columns;
        let x = Volume {
            channels: CONV2_CHANNELS,
            size: geometry.feature_map,
            values: (0..count).map(|index| index as f32).collect(),
        };
        let pooled = max_pool(&x, &geometry);
        assert_eq!(pooled.len(), CONV2_CHANNELS * 12 * 3 * 4);
        // Channel 1, step 2, pool row 1, pool column 2: the values increase, so the maximum is in
        // the last row and column of the pool.
        let last = ((steps + 2) * rows + 5) * columns + 5;
        assert_eq!(pooled[((12 + 2) * 3 + 1) * 4 + 2], last as f32);
    }

    #[test]
    fn pca_codes_are_inner_products_with_the_components() {
        let artifact = testing::pca();
        let encoder = FloatEncoder::new(&artifact).unwrap();
        // Component k of the test model selects feature k.
        let count = artifact.description.dimensions().window_electrodes();
        let electrodes: Vec<f32> = (0..count).map(|feature| feature as f32).collect();
        let code = encoder.encode(&ScalpGrid::new(&artifact.description).scatter(&electrodes));
        assert_eq!(code, electrodes[..128]);
    }

    #[test]
    fn a_constant_window_has_the_code_worked_out_by_hand() {
        // In testing::shortcut, conv1 channel 0 = 0.5 + sum of 27 cells; the norms have gain 2 and
        // offset 0.25; conv2 channel 0 = 0.1 * centre tap of channel 0; output 0 of fc = 1 + pooled
        // value 0; the shortcut is 0.
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
        // With testing::shortcut_with, output 0 of fc = 1 + pooled value 0, the corner of the
        // feature map. There conv2's centre tap reads the corner of conv1's output, which sums the
        // cells inside the window: 8 of 27 with padded steps, 12 without.
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
