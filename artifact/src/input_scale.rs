use crate::error::ArtifactError;
use crate::folder::Artifact;

/// The quantised input and activations reach this much further than the calibration set did:
/// clipping costs far more than resolution.
pub const HEAD_ROOM: f64 = 1.25;

impl Artifact {
    /// Microvolt per step of the encoder's int8 input; its zero is 0 uV.
    ///
    /// # Errors
    /// When the calibration has no `input.max_abs`; not after [`Artifact::read`].
    pub fn input_scale_uv(&self) -> Result<f64, ArtifactError> {
        let max_abs = self.calibration.tensor("input.max_abs", &[1])?[0];
        Ok(f64::from(max_abs) * HEAD_ROOM / 127.0)
    }
}
