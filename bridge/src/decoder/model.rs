//! The device's model on this side.

use std::path::Path;

use artifact::{Artifact, ArtifactError, FloatDecoder, FloatEncoder, ModelId, WINDOW_CELLS};
use link::CODE_LEN;

use crate::device::Device;

/// What turns codes of one model id back into microvolts, and windows into the codes that a device
/// of that id should make of them.
#[derive(Clone, Debug)]
pub struct Model {
    id: ModelId,
    encoder: FloatEncoder,
    decoder: FloatDecoder,
    /// Float input per step of the device's int8 input.
    input_scale: f32,
    sd_uv: f32,
    steps: usize,
    rate_hz: u32,
    electrodes: Vec<String>,
}

impl Model {
    /// The model that this program was built with.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if its codes do not decode by themselves.
    pub fn embedded() -> Result<Model, ArtifactError> {
        Model::new(&Artifact::from_bytes(
            include_str!("../../../model/artifact/model.toml"),
            include_bytes!("../../../model/artifact/weights.safetensors"),
            include_bytes!("../../../model/artifact/calibration.safetensors"),
        )?)
    }

    /// The model in a folder.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if the folder holds no model, or one whose codes do not decode.
    pub fn read(folder: &Path) -> Result<Model, ArtifactError> {
        Model::new(&Artifact::read(folder)?)
    }

    /// Decoder and encoder of an artifact.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if its codes do not decode by themselves.
    pub fn new(artifact: &Artifact) -> Result<Model, ArtifactError> {
        let description = &artifact.description;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a standard deviation, about 50"
        )]
        let sd_uv = description.input.sd_uv as f32;
        #[expect(clippy::cast_possible_truncation, reason = "a scale, about 0.1")]
        let input_scale = (artifact.input_scale_uv()? / description.input.sd_uv) as f32;
        Ok(Model {
            id: artifact.id,
            encoder: FloatEncoder::new(artifact)?,
            input_scale,
            decoder: FloatDecoder::new(artifact)?,
            sd_uv,
            steps: description.window.steps,
            rate_hz: description.window.rate_hz,
            electrodes: description.montage.electrodes.clone(),
        })
    }

    /// Its id, as codes and `Hello` carry it.
    pub fn id(&self) -> [u8; 8] {
        self.id.0
    }

    /// Electrodes in the order of the montage.
    pub fn electrodes(&self) -> &[String] {
        &self.electrodes
    }

    /// Why this model cannot decode the device's codes; `None` if it can.
    pub fn objection(&self, device: &Device) -> Option<String> {
        if device.model_id != self.id.0 {
            return Some(format!(
                "the device runs model {} and this bridge decodes {}; codes are published, their \
                 reconstruction is not: start again with --model and the folder of the device's \
                 model, or bring that model to the device",
                ModelId(device.model_id),
                self.id
            ));
        }
        let same = usize::from(device.window_steps) == self.steps
            && u32::from(device.step_rate_hz) == self.rate_hz
            && device.labels == self.electrodes;
        (!same).then(|| {
            format!(
                "the device names model {} but describes another montage or window; codes are \
                 published, their reconstruction is not: bring firmware and bridge to the same \
                 release",
                self.id
            )
        })
    }

    /// The window of a code in microvolts, electrode fastest.
    pub fn decode(&self, z: &[f32; CODE_LEN]) -> Vec<f32> {
        let mut window = self.decoder.decode(z);
        for value in &mut window {
            *value *= self.sd_uv;
        }
        window
    }

    /// Cells of a window.
    pub fn window_cells(&self) -> usize {
        WINDOW_CELLS
    }

    /// The code that the float network makes of a window as a device reads it: int8 cells, plane by
    /// plane; missing ones count as 0.
    pub fn encode(&self, planes: &[i8]) -> [f32; CODE_LEN] {
        let mut window = [0.0; WINDOW_CELLS];
        for (cell, step) in window.iter_mut().zip(planes) {
            *cell = f32::from(*step) * self.input_scale;
        }
        self.encoder.encode(&window)
    }
}
