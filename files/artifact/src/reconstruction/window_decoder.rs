//! Decodes one code to the electrode signals of its window: dequantises its levels, then runs the
//! float decoder.

use crate::{Artifact, ArtifactError, FloatDecoder};

/// Decoder for the codes of one model, which returns microvolts.
#[derive(Clone, Debug)]
pub struct WindowDecoder {
    network: FloatDecoder,
    /// Microvolts for each unit of the network's output.
    sd_uv: f32,
}

impl WindowDecoder {
    /// Builds the decoder of an artifact.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if a tensor is missing, or if the mode is `paper`, whose decoder needs
    /// pool indices in addition to the code.
    pub fn new(artifact: &Artifact) -> Result<WindowDecoder, ArtifactError> {
        #[expect(clippy::cast_possible_truncation, reason = "a standard deviation, about 50")]
        let sd_uv = artifact.description.input.sd_uv as f32;
        Ok(WindowDecoder { network: FloatDecoder::new(artifact)?, sd_uv })
    }

    /// Returns the electrode signals, in microvolts, of the window with the dequantised code `z`:
    /// all electrodes of the first step, then of the next step, and so on.
    ///
    /// # Panics
    /// If `z` does not have the length of the model's codes.
    pub fn decode(&self, z: &[f32]) -> Vec<f32> {
        let mut window = self.network.decode(z);
        for value in &mut window {
            *value *= self.sd_uv;
        }
        window
    }
}

/// Dequantises one level of a code: `(level - zero_point) * scale`. |level| must be below 2^16.
#[expect(clippy::cast_precision_loss, reason = "the difference has 17 bits at most")]
pub fn dequantise(level: i32, scale: f32, zero_point: i8) -> f32 {
    (level - i32::from(zero_point)) as f32 * scale
}

/// Returns the smallest and the largest value that any number of a code can dequantise to, for
/// levels from `least` to `greatest`; zeros for a code without numbers.
pub fn code_range([least, greatest]: [i32; 2], scale: &[f32], zero_point: &[i8]) -> [f32; 2] {
    if scale.is_empty() {
        return [0.0; 2];
    }
    let ends = |level| {
        let numbers = scale.iter().zip(zero_point);
        numbers.map(move |(scale, zero_point)| dequantise(level, *scale, *zero_point))
    };
    [ends(least).fold(f32::INFINITY, f32::min), ends(greatest).fold(f32::NEG_INFINITY, f32::max)]
}
