//! The files of a packed model: `packed.toml` and `packed.safetensors`.

use super::description::PackedDescription;
use super::file_names::{DESCRIPTION, TENSORS};
use super::integer_matrix::IntegerMatrix;
use super::model::PackedModel;
use super::smoother::Smoother;
use crate::description::Description;
use crate::error::ArtifactError;
use packed::{LEVELS, MAGNITUDES, RATES, Starts};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::path::Path;

/// Names of the tensors.
const NAMES: [&str; 9] = [
    "analysis.weight",
    "analysis.factor",
    "prediction.weight",
    "prediction.factor",
    "levels.predicted",
    "levels.reset",
    "starts",
    "smoother.weight",
    "smoother.scale",
];

/// Contents of the two files.
#[derive(Clone, Debug)]
pub(crate) struct PackedFiles {
    pub(crate) description: String,
    pub(crate) tensors: Vec<u8>,
}

impl PackedFiles {
    /// Reads the two files of a folder; `None` if it has neither.
    ///
    /// # Errors
    /// If one of them is missing, or cannot be read.
    pub(crate) fn read(folder: &Path) -> Result<Option<Self>, ArtifactError> {
        let [description, tensors] = [DESCRIPTION, TENSORS].map(|name| folder.join(name));
        if !description.exists() && !tensors.exists() {
            return Ok(None);
        }
        let half = |missing: &Path, other| ArtifactError::PackedHalf {
            missing: missing.to_owned(),
            other,
        };
        if !description.exists() {
            return Err(half(&description, TENSORS));
        }
        if !tensors.exists() {
            return Err(half(&tensors, DESCRIPTION));
        }
        let error = |path| move |source| ArtifactError::File { path, source };
        Ok(Some(Self {
            description: std::fs::read_to_string(&description).map_err(error(description))?,
            tensors: std::fs::read(&tensors).map_err(error(tensors))?,
        }))
    }
}

impl PackedModel {
    /// Parses the two files and checks them.
    pub(crate) fn parse(
        toml: &str,
        tensors: &[u8],
        description: &Description,
    ) -> Result<Self, ArtifactError> {
        let packed: PackedDescription = toml::from_str(toml).map_err(ArtifactError::PackedToml)?;
        let file =
            SafeTensors::deserialize(tensors).map_err(|source| ArtifactError::Safetensors {
                file: TENSORS,
                source,
            })?;
        if let Some(name) = file.names().iter().find(|name| !NAMES.contains(name)) {
            return Err(ArtifactError::UnknownTensor {
                file: TENSORS,
                name: (*name).to_owned(),
            });
        }
        let values = description.montage.electrodes.len() * description.window.hop;
        let count = packed.coefficients;
        let matrix = |name: &str, inputs| -> Result<IntegerMatrix, ArtifactError> {
            let weights = elements(
                &file,
                &format!("{name}.weight"),
                Dtype::I8,
                &[count, inputs],
            )?;
            let factors = elements(&file, &format!("{name}.factor"), Dtype::I32, &[count])?;
            Ok(IntegerMatrix {
                weights: weights.iter().map(|byte| byte.cast_signed()).collect(),
                factors: words(factors).map(i32::from_le_bytes).collect(),
            })
        };
        let levels =
            |name| Ok::<_, ArtifactError>(elements(&file, name, Dtype::U8, &[count])?.to_vec());
        let square = [RATES, count, count];
        let smoother = elements(&file, "smoother.weight", Dtype::I8, &square)?;
        let scales = elements(&file, "smoother.scale", Dtype::F32, &square[..2])?;
        let model = Self {
            analysis: matrix("analysis", values)?,
            prediction: matrix("prediction", count)?,
            predicted_levels: levels("levels.predicted")?,
            reset_levels: levels("levels.reset")?,
            starts: table(elements(
                &file,
                "starts",
                Dtype::U16,
                &[2, LEVELS, MAGNITUDES],
            )?),
            smoother: Smoother {
                weights: smoother.iter().map(|byte| byte.cast_signed()).collect(),
                scales: words(scales).map(f32::from_le_bytes).collect(),
            },
            description: packed,
        };
        model.check(description)?;
        Ok(model)
    }

    /// Checks dimensions and proves the ranges of all sums.
    pub(crate) fn check(&self, description: &Description) -> Result<(), ArtifactError> {
        super::ranges::check(self, description)
    }

    /// Returns the contents of the two files.
    pub(crate) fn to_files(&self) -> Result<PackedFiles, ArtifactError> {
        let count = self.coefficients();
        let bytes_of = |weights: &[i8]| weights.iter().map(|w| w.cast_unsigned()).collect();
        let words_of = |words: &[i32]| words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let starts = self.starts.iter().flatten().flatten();
        let tensors: [(&str, Dtype, Vec<usize>, Vec<u8>); 9] = [
            (
                "analysis.weight",
                Dtype::I8,
                vec![count, self.analysis.inputs()],
                bytes_of(&self.analysis.weights),
            ),
            (
                "analysis.factor",
                Dtype::I32,
                vec![count],
                words_of(&self.analysis.factors),
            ),
            (
                "prediction.weight",
                Dtype::I8,
                vec![count, count],
                bytes_of(&self.prediction.weights),
            ),
            (
                "prediction.factor",
                Dtype::I32,
                vec![count],
                words_of(&self.prediction.factors),
            ),
            (
                "levels.predicted",
                Dtype::U8,
                vec![count],
                self.predicted_levels.clone(),
            ),
            (
                "levels.reset",
                Dtype::U8,
                vec![count],
                self.reset_levels.clone(),
            ),
            (
                "starts",
                Dtype::U16,
                vec![2, LEVELS, MAGNITUDES],
                starts.flat_map(|start| start.to_le_bytes()).collect(),
            ),
            (
                "smoother.weight",
                Dtype::I8,
                vec![RATES, count, count],
                bytes_of(&self.smoother.weights),
            ),
            (
                "smoother.scale",
                Dtype::F32,
                vec![RATES, count],
                self.smoother
                    .scales
                    .iter()
                    .flat_map(|scale| scale.to_le_bytes())
                    .collect(),
            ),
        ];
        let failed = |source| ArtifactError::Safetensors {
            file: TENSORS,
            source,
        };
        let views = tensors
            .iter()
            .map(|(name, kind, shape, bytes)| {
                Ok((
                    *name,
                    TensorView::new(*kind, shape.clone(), bytes).map_err(failed)?,
                ))
            })
            .collect::<Result<Vec<_>, ArtifactError>>()?;
        Ok(PackedFiles {
            description: toml::to_string(&self.description)?,
            tensors: safetensors::serialize(views, None).map_err(failed)?,
        })
    }
}

/// Returns the bytes of a tensor of the expected type and shape.
fn elements<'f>(
    file: &SafeTensors<'f>,
    name: &str,
    kind: Dtype,
    shape: &[usize],
) -> Result<&'f [u8], ArtifactError> {
    let view = file
        .tensor(name)
        .map_err(|_| ArtifactError::MissingTensor {
            file: TENSORS,
            name: name.to_owned(),
        })?;
    if view.dtype() != kind {
        let expected = match kind {
            Dtype::I8 => "I8",
            Dtype::U8 => "U8",
            Dtype::U16 => "U16",
            Dtype::I32 => "I32",
            _ => "F32",
        };
        return Err(ArtifactError::ElementType {
            file: TENSORS,
            name: name.to_owned(),
            found: view.dtype().to_string(),
            expected,
        });
    }
    if view.shape() != shape {
        return Err(ArtifactError::Shape {
            file: TENSORS,
            name: name.to_owned(),
            found: view.shape().to_vec(),
            expected: shape.to_vec(),
        });
    }
    Ok(view.data())
}

fn words(bytes: &[u8]) -> impl Iterator<Item = [u8; 4]> {
    bytes.as_chunks().0.iter().copied()
}

fn table(bytes: &[u8]) -> Box<Starts> {
    let mut table = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    let numbers = bytes
        .as_chunks()
        .0
        .iter()
        .map(|&bytes| u16::from_le_bytes(bytes));
    for (place, number) in table.iter_mut().flatten().flatten().zip(numbers) {
        *place = number;
    }
    table
}
