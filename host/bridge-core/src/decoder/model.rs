//! A model's network in floating point, with encoder and decoder, and the model's packed code.

use std::path::Path;

use artifact::reconstruction::WindowDecoder;
use artifact::{
    Artifact, ArtifactError, Dimensions, FloatEncoder, ModelId, PackedModel, ScalpGrid,
};

use crate::device::Device;

/// Names and contents of the files of the model that is embedded in this program.
const EMBEDDED: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/embedded_model.rs"));

/// The float network of one model, and the model's packed code if it has one. Decodes the codes of
/// devices with this model, and computes the code that a correct device returns for a window. A
/// model can lack the network; its codes then have no values.
#[derive(Clone, Debug)]
pub struct Model {
    id: ModelId,
    encoder: FloatEncoder,
    decoder: WindowDecoder,
    packed: Option<PackedModel>,
    grid: ScalpGrid,
    /// Standard deviation of the data that the model was trained on, microvolts.
    sd_uv: f64,
    /// Value at the float network's input that corresponds to one level of the device's int8 input.
    input_scale: f32,
    dimensions: Dimensions,
    hop: usize,
    rate_hz: u32,
    electrodes: Vec<String>,
}

impl Model {
    /// Reads the model that is embedded in this program: the checked-in one, or the one in the
    /// folder that `CORTICODE_ARTIFACT` named when the program was built.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if the model's decoder needs more input than the code.
    pub fn embedded() -> Result<Model, ArtifactError> {
        Model::read(None)
    }

    /// Reads the model in `folder` (`model.toml` and the weights), or the embedded model if `None`.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if the folder holds no valid model, or if the model's decoder needs more
    /// input than the code.
    pub fn read(folder: Option<&Path>) -> Result<Model, ArtifactError> {
        Model::new(&Model::artifact(folder)?)
    }

    /// Reads the parts of the model in `folder`, or of the embedded model if `None`.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if the folder holds no valid model.
    pub fn artifact(folder: Option<&Path>) -> Result<Artifact, ArtifactError> {
        match folder {
            Some(folder) => Artifact::read(folder),
            None => Artifact::from_files(EMBEDDED),
        }
    }

    /// Builds the float encoder and decoder, and the packed code, from the description and tensors
    /// in `artifact`.
    ///
    /// # Errors
    ///
    /// [`ArtifactError`] if a tensor is missing, or if the model's decoder needs more input than
    /// the code.
    pub fn new(artifact: &Artifact) -> Result<Model, ArtifactError> {
        let description = &artifact.description;
        #[expect(clippy::cast_possible_truncation, reason = "a scale, about 0.1")]
        let input_scale = (artifact.input_scale_uv()? / description.input.sd_uv) as f32;
        Ok(Model {
            id: artifact.id,
            encoder: FloatEncoder::new(artifact)?,
            input_scale,
            decoder: WindowDecoder::new(artifact)?,
            packed: artifact.packed.clone(),
            grid: ScalpGrid::new(description),
            sd_uv: description.input.sd_uv,
            dimensions: description.dimensions(),
            hop: description.window.hop,
            rate_hz: description.window.rate_hz,
            electrodes: description.montage.electrodes.clone(),
        })
    }

    /// Returns the model id, 8 bytes. Codes and the device's `Hello` contain the same id.
    pub fn id(&self) -> [u8; 8] {
        self.id.0
    }

    /// Returns the electrode labels in the order of the montage.
    pub fn electrodes(&self) -> &[String] {
        &self.electrodes
    }

    /// Returns the reason why this model cannot decode the device's codes and packed blocks, worded
    /// for the user; `None` if it can decode them.
    pub fn objection(&self, device: &Device) -> Option<String> {
        if device.model_id != self.id.0 {
            return Some(format!(
                "the device has model {coded} and this program decodes {own}; signals are not \
                 reconstructed: start the program again with --model and the folder of \
                 model {coded}",
                coded = ModelId(device.model_id),
                own = self.id
            ));
        }
        // After the upload of a packed code alone, a device still has its own network and codes.
        let numbers = self.dimensions.numbers;
        let same = self.fits(device) && (numbers == 0 || device.numbers() == numbers);
        (!same).then(|| {
            format!(
                "the device reports model {} but another montage or window; signals are not \
                 reconstructed: bring the device and this program to the same release",
                self.id
            )
        })
    }

    /// Returns whether device and model have the same electrodes, rate, window and hop.
    pub fn fits(&self, device: &Device) -> bool {
        usize::from(device.window_steps) == self.dimensions.steps
            && usize::from(device.hop_steps) == self.hop
            && u32::from(device.step_rate_hz) == self.rate_hz
            && device.labels == self.electrodes
    }

    /// Decodes the values `z` of a code to the electrode signals of its window, microvolts: all
    /// electrodes of the first step, then all electrodes of the next step, and so on.
    pub fn decode(&self, z: &[f32]) -> Vec<f32> {
        self.decoder.decode(z)
    }

    /// Returns the packed code of this model; `None` if it has none.
    pub fn packed(&self) -> Option<&PackedModel> {
        self.packed.as_ref()
    }

    /// Returns the standard deviation of the data that the model was trained on, microvolts.
    pub fn sd_uv(&self) -> f64 {
        self.sd_uv
    }

    /// Returns two results in microvolts: the electrode signals of a window (all electrodes of the
    /// first step, then of the next), and the voltage of one int8 level. `planes` holds the
    /// encoder's input for the window; missing cells count as 0.
    pub fn electrodes_uv(&self, planes: &[i8]) -> (Vec<f32>, f64) {
        let level_uv = f64::from(self.input_scale) * self.sd_uv;
        let mut cells = vec![0.0; self.window_cells()];
        #[expect(clippy::cast_possible_truncation, reason = "published as f32")]
        for (cell, level) in cells.iter_mut().zip(planes) {
            *cell = (f64::from(*level) * level_uv) as f32;
        }
        (self.grid.gather(&cells), level_uv)
    }

    /// Returns the number of scalp-grid cells in a window: cells per plane times steps.
    pub fn window_cells(&self) -> usize {
        self.dimensions.window_cells()
    }

    /// Computes the code of a window with the float network. `planes` holds the device's input for
    /// the window: int8 cells, plane by plane. Missing cells count as 0.
    pub fn encode(&self, planes: &[i8]) -> Vec<f32> {
        let mut window = vec![0.0; self.window_cells()];
        for (cell, step) in window.iter_mut().zip(planes) {
            *cell = f32::from(*step) * self.input_scale;
        }
        self.encoder.encode(&window)
    }
}
