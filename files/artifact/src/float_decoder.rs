//! The decoder in f32: computes the electrode signals of a window from its code.

use crate::convolution::{Convolution, Dense, Norm, add_product, read_shortcut};
use crate::description::Mode;
use crate::error::ArtifactError;
use crate::folder::Artifact;
use crate::geometry::{CONV1_CHANNELS, CONV2_CHANNELS, Geometry};
use crate::scalp_grid::ScalpGrid;
use crate::tensors::Tensors;
use crate::unpooled_convolution::UnpooledConvolution;

/// The decoder in f32: a fully connected layer, nearest-neighbour unpooling, a transposed
/// convolution with ReLU and batch norm, and a second transposed convolution. If the mode has a
/// linear shortcut from the code, its output is added. In mode `packed`, which has no codes, every
/// decoded window is 0.
#[derive(Clone, Debug)]
pub struct FloatDecoder {
    geometry: Geometry,
    grid: ScalpGrid,
    convolutions: Option<Convolutions>,
    /// Weights of the shortcut, `[step][electrode][number]`; `None` if the mode has no shortcut.
    shortcut: Option<Vec<f32>>,
}

#[derive(Clone, Debug)]
struct Convolutions {
    fc: Dense,
    conv1: UnpooledConvolution,
    norm1: Norm,
    conv2: Convolution,
}

impl FloatDecoder {
    /// Builds the decoder of an artifact.
    ///
    /// # Errors
    /// If the mode is `paper`, whose codes alone cannot be decoded; or if the artifact's tensors do
    /// not fit its mode, which is impossible after [`Artifact::read`].
    pub fn new(artifact: &Artifact) -> Result<Self, ArtifactError> {
        let description = &artifact.description;
        if description.mode == Mode::Paper {
            return Err(ArtifactError::NotDecodable);
        }
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
            shortcut: read_shortcut(artifact, "decoder.shortcut.weight", [window, numbers])?,
        })
    }

    /// Returns the window of a code in the order step, electrode (the last fastest), in units of
    /// `input.sd_uv` microvolts.
    ///
    /// # Panics
    /// If `code` does not have the length of the model's codes.
    pub fn decode(&self, code: &[f32]) -> Vec<f32> {
        let dimensions = &self.geometry.dimensions;
        assert_eq!(code.len(), dimensions.numbers, "numbers of a code");
        let mut window = match &self.convolutions {
            Some(convolutions) => self.grid.gather(&convolutions.decode(code, &self.geometry)),
            None => vec![0.0; dimensions.window_electrodes()],
        };
        if let Some(shortcut) = &self.shortcut {
            add_product(&mut window, shortcut, code);
        }
        window
    }
}

impl Convolutions {
    fn read(weights: &Tensors, geometry: &Geometry) -> Result<Self, ArtifactError> {
        let [first, second] = [
            ("decoder.conv1", [CONV2_CHANNELS, CONV1_CHANNELS]),
            ("decoder.conv2", [CONV1_CHANNELS, 1]),
        ]
        .map(|(name, shape)| Convolution::read(weights, name, shape, shape[1]));
        let fc_shape = [geometry.flat(), geometry.dimensions.numbers];
        Ok(Self {
            fc: Dense::read(weights, "decoder.fc", fc_shape)?,
            conv1: UnpooledConvolution::new(&first?, geometry),
            norm1: Norm::read(weights, "decoder.norm1", CONV1_CHANNELS)?,
            conv2: second?,
        })
    }

    /// Returns the window of a code on the grid, in the order step, row, column (the last fastest).
    fn decode(&self, code: &[f32], geometry: &Geometry) -> Vec<f32> {
        let mut x = self.conv1.forward(&self.fc.forward(code));
        x.relu();
        self.norm1.apply(&mut x);
        let y = self.conv2.forward_transposed(&x);
        y.cropped(geometry.padding.pads()).values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn a_model_of_mode_paper_has_no_decoder() {
        let mut artifact = testing::shortcut();
        artifact.description.mode = Mode::Paper;
        assert!(matches!(FloatDecoder::new(&artifact), Err(ArtifactError::NotDecodable)));
    }
}
