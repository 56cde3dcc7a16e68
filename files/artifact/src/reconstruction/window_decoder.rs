//! Decodes one code to the electrode signals of its window.

use crate::{Artifact, ArtifactError, FloatDecoder};

/// The float decoder of one model, with the scale of its output.
#[derive(Clone, Debug)]
pub struct WindowDecoder {
    network: FloatDecoder,
    /// Microvolts per unit of the network's output.
    sd_uv: f32,
}

impl WindowDecoder {
    /// Builds the decoder of an artifact.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if a tensor is missing, or if the model's decoder needs more input than
    /// the code.
    pub fn new(artifact: &Artifact) -> Result<WindowDecoder, ArtifactError> {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a standard deviation, about 50"
        )]
        let sd_uv = artifact.description.input.sd_uv as f32;
        Ok(WindowDecoder {
            network: FloatDecoder::new(artifact)?,
            sd_uv,
        })
    }

    /// Decodes a dequantised code to the electrode signals of its window, microvolts: all
    /// electrodes of the first step, then all electrodes of the next step, and so on.
    ///
    /// # Panics
    ///
    /// If the code's length is not that of the model's codes.
    pub fn decode(&self, z: &[f32]) -> Vec<f32> {
        let mut window = self.network.decode(z);
        for value in &mut window {
            *value *= self.sd_uv;
        }
        window
    }
}
