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
/// convolution with ReLU and batch norm, and a second transposed convolution. A linear shortcut
/// from the code is added to their output, if the mode has one. In mode `packed`, which has no
/// codes, every decoded window is 0.
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
    /// If the code's length is not that of the model's codes.
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
    use crate::description::{NetworkShape, Padding};
    use crate::float_encoder::FloatEncoder;
    use crate::testing;

    #[test]
    fn pca_decoding_inverts_encoding_for_windows_spanned_by_the_components() {
        let artifact = testing::pca();
        let decoder = FloatDecoder::new(&artifact).unwrap();
        let code: [f32; 128] = core::array::from_fn(|index| index as f32 + 1.0);
        let window = decoder.decode(&code);
        assert_eq!(window[..128], code);
        assert!(window[128..].iter().all(|value| *value == 0.0));
        let grid = ScalpGrid::new(&artifact.description);
        let encoder = FloatEncoder::new(&artifact).unwrap();
        assert_eq!(encoder.encode(&grid.scatter(&window)), code);
    }

    #[test]
    fn a_code_decodes_to_the_window_worked_out_by_hand() {
        // The model has few weights that are not 0. decoder.fc copies number 0 of the code to
        // output 0, which is unpooled to a region at the origin. Tap (0,0,0) of conv1 is 1; the
        // norm has gain 2 and offset 0.25; tap (2,2,2) of conv2 is 1, and its bias is -0.5. On an
        // unpadded axis, the transposed conv1 leaves the region in place and conv2 moves it by +2.
        // On a padded axis, conv1 moves it by -1, which cuts off its start, and conv2 by +1. Inside
        // the region, a value is gain * code + offset + bias. Outside, it is offset + bias from the
        // first position that conv2's tap reaches, and the bias alone before it. Each case states
        // padding, pool, the region in the decoded window, and this first position.
        let cases = [
            (Padding::None, [2, 2, 2], [2..4, 2..4, 2..5], [2, 2, 2]),
            (Padding::None, [4, 3, 5], [2..6, 2..5, 2..7], [2, 2, 2]),
            (Padding::Space, [2, 3, 3], [2..4, 1..4, 1..3], [2, 1, 1]),
            (Padding::All, [2, 2, 4], [1..2, 1..2, 1..5], [1, 1, 1]),
        ];
        for (padding, pool, covered, first) in cases {
            let mut description = testing::description();
            description.network = NetworkShape { padding, pool };
            let artifact = testing::shortcut_with(description);
            let decoder = FloatDecoder::new(&artifact).unwrap();
            let mut code = [0.0; 128];
            code[0] = 3.0;
            let window = decoder.decode(&code);
            let grid = ScalpGrid::new(&artifact.description);
            for (index, value) in window.iter().enumerate() {
                let cell = grid.cell_of_electrode()[index % 61];
                let at = [index / 61, cell / 9, cell % 9];
                let inside = (0..3).all(|axis| covered[axis].contains(&at[axis]));
                let reached = (0..3).all(|axis| at[axis] >= first[axis]);
                let expected = match (inside, reached) {
                    (true, _) => 2.0 * 3.0 + 0.25 - 0.5,
                    (false, true) => 0.25 - 0.5,
                    (false, false) => -0.5,
                };
                assert!(
                    (value - expected).abs() < 1e-4,
                    "{padding:?} {pool:?}, {at:?}: {value} is not {expected}"
                );
            }
        }
    }

    #[test]
    fn a_model_of_mode_paper_has_no_decoder() {
        let mut artifact = testing::shortcut();
        artifact.description.mode = Mode::Paper;
        assert!(matches!(
            FloatDecoder::new(&artifact),
            Err(ArtifactError::NotDecodable)
        ));
    }
}
