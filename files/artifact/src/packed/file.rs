//! The files of a packed model: `packed.toml` and `packed.safetensors`.

use super::model::{IntegerMatrix, PackedDescription, PackedModel, Smoother};
use super::ranges;
use crate::description::Description;
use crate::error::{ArtifactError, TensorProblem};
use crate::tensor_file::{self, NamedTensor, TensorFile};
use packed::{LEVELS, MAGNITUDES, RATES, Starts};
use safetensors::tensor::Dtype;

/// Name of the file with the dimensions, units and test results of a packed model.
pub(crate) const DESCRIPTION: &str = "packed.toml";
/// Name of the file with the tensors of a packed model. All are integers except the synthesis and
/// the smoother's scales.
pub(crate) const TENSORS: &str = "packed.safetensors";

/// Names of the tensors in `packed.safetensors`.
const NAMES: [&str; 10] = [
    "analysis.weight",
    "analysis.factor",
    "prediction.weight",
    "prediction.factor",
    "levels.predicted",
    "levels.reset",
    "starts",
    "smoother.weight",
    "smoother.scale",
    SYNTHESIS,
];

/// Name of the synthesis tensor, which only weighted models have.
pub(super) const SYNTHESIS: &str = "synthesis";

impl PackedModel {
    /// Parses both files and checks that they are a packed model which fits `description`.
    pub(crate) fn parse(
        toml: &[u8],
        tensors: &[u8],
        description: &Description,
    ) -> Result<Self, ArtifactError> {
        let packed: PackedDescription =
            toml::from_slice(toml).map_err(ArtifactError::toml(DESCRIPTION))?;
        let file = TensorFile::parse(TENSORS, tensors)?;
        if let Some(name) = file.names().iter().find(|name| !NAMES.contains(name)) {
            return Err(TensorProblem::Unknown.of(TENSORS, name));
        }
        let values = description.montage.electrodes.len() * description.window.hop;
        let count = packed.coefficients;
        let matrix = |name: &str, inputs| -> Result<IntegerMatrix, ArtifactError> {
            let weights = file.elements(&format!("{name}.weight"), Dtype::I8, &[count, inputs])?;
            let factors = file.elements(&format!("{name}.factor"), Dtype::I32, &[count])?;
            Ok(IntegerMatrix {
                weights: weights.iter().map(|byte| byte.cast_signed()).collect(),
                factors: words(factors).map(i32::from_le_bytes).collect(),
            })
        };
        let levels =
            |name| Ok::<_, ArtifactError>(file.elements(name, Dtype::U8, &[count])?.to_vec());
        let square = [RATES, count, count];
        let smoother = file.elements("smoother.weight", Dtype::I8, &square)?;
        let scales = file.elements("smoother.scale", Dtype::F32, &square[..2])?;
        let floats = |bytes| words(bytes).map(f32::from_le_bytes).collect();
        let synthesis = file.names().contains(&SYNTHESIS).then(|| {
            let bytes = file.elements(SYNTHESIS, Dtype::F32, &[count, values])?;
            Ok::<_, ArtifactError>(floats(bytes))
        });
        let model = Self {
            analysis: matrix("analysis", values)?,
            prediction: matrix("prediction", count)?,
            predicted_levels: levels("levels.predicted")?,
            reset_levels: levels("levels.reset")?,
            starts: table(file.elements("starts", Dtype::U16, &[2, LEVELS, MAGNITUDES])?),
            smoother: Smoother {
                weights: smoother.iter().map(|byte| byte.cast_signed()).collect(),
                scales: floats(scales),
            },
            synthesis: synthesis.transpose()?,
            description: packed,
        };
        ranges::check(&model, description)?;
        Ok(model)
    }

    /// Returns names and contents of `packed.toml` and `packed.safetensors`.
    pub(crate) fn to_files(&self) -> Result<[(&'static str, Vec<u8>); 2], ArtifactError> {
        let tensors = tensor_file::to_bytes(TENSORS, &self.tensors(self.analysis.inputs()))?;
        let description = toml::to_string(&self.description)?.into_bytes();
        Ok([(DESCRIPTION, description), (TENSORS, tensors)])
    }

    /// Returns the tensors of `packed.safetensors` for blocks of `values` values. The shapes follow
    /// from the dimensions; in an unchecked model, a tensor's number of elements can contradict its
    /// shape.
    pub(super) fn tensors(&self, values: usize) -> Vec<NamedTensor<'static>> {
        let count = self.coefficients();
        let bytes = |weights: &[i8]| weights.iter().map(|w| w.cast_unsigned()).collect();
        let words = |words: &[i32]| words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let (analysis, prediction, smoother) = (&self.analysis, &self.prediction, &self.smoother);
        let starts = self.starts.iter().flatten().flatten();
        let starts = starts.flat_map(|start| start.to_le_bytes()).collect();
        let floats = |floats: &[f32]| floats.iter().flat_map(|f| f.to_le_bytes()).collect();
        let synthesis = self.synthesis.as_ref();
        let synthesis = synthesis.map(|s| (Dtype::F32, vec![count, values], floats(s)));
        let shape = |lengths: &[usize]| lengths.to_vec();
        let contents = [
            (Dtype::I8, shape(&[count, values]), bytes(&analysis.weights)),
            (Dtype::I32, shape(&[count]), words(&analysis.factors)),
            (Dtype::I8, shape(&[count, count]), bytes(&prediction.weights)),
            (Dtype::I32, shape(&[count]), words(&prediction.factors)),
            (Dtype::U8, shape(&[count]), self.predicted_levels.clone()),
            (Dtype::U8, shape(&[count]), self.reset_levels.clone()),
            (Dtype::U16, shape(&[2, LEVELS, MAGNITUDES]), starts),
            (Dtype::I8, shape(&[RATES, count, count]), bytes(&smoother.weights)),
            (Dtype::F32, shape(&[RATES, count]), floats(&smoother.scales)),
        ];
        let contents = NAMES.into_iter().zip(contents.into_iter().chain(synthesis));
        contents.map(|(name, (kind, shape, bytes))| (name, kind, shape, bytes)).collect()
    }
}

fn words(bytes: &[u8]) -> impl Iterator<Item = [u8; 4]> {
    bytes.as_chunks().0.iter().copied()
}

fn table(bytes: &[u8]) -> Box<Starts> {
    let mut table = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    let numbers = bytes.as_chunks().0.iter().map(|&bytes| u16::from_le_bytes(bytes));
    for (place, number) in table.iter_mut().flatten().flatten().zip(numbers) {
        *place = number;
    }
    table
}
