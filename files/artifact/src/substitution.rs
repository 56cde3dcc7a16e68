//! The table with which a device finds and substitutes bad electrodes.

use crate::description::{Description, Person};
use crate::error::{ArtifactError, TensorProblem};
use crate::tensor_file::{self, TensorFile};
use safetensors::tensor::Dtype;
use serde::{Deserialize, Serialize};

/// Name of the file with the training and test results of a table.
pub(crate) const DESCRIPTION: &str = "substitution.toml";
/// Name of the file with the integers of a table.
pub(crate) const TENSORS: &str = "substitution.safetensors";

const WEIGHTS: &str = "weights";
const INNOVATION: &str = "innovation";

/// Largest permitted mean square of an innovation (an electrode minus its prediction), in (1/16
/// uV)^2; it is (512 uV)^2.
pub const LARGEST_INNOVATION: i32 = 1 << 26;

/// Largest sum of the magnitudes of a row's weights. Inputs are at most 4,096 in magnitude, so a
/// prediction then fits the device's 24-bit accumulator. Trained tables reach about 1,200.
const LARGEST_ROW: u32 = 2_047;

/// How a table was trained: the contents of `substitution.toml`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SubstitutionDescription {
    /// Version of the file format, always 1.
    pub format: u32,
    /// Training recordings, test recordings and test results.
    pub training: SubstitutionTraining,
}

/// Recordings with which a table was trained and tested, and the results.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SubstitutionTraining {
    /// File names of the training recordings.
    pub train_files: Vec<String>,
    /// File names of the test recordings.
    pub test_files: Vec<String>,
    /// Electrodes that a training recording lacks. Their rows predict an interpolation, not a
    /// measurement.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub interpolated: Vec<String>,
    /// People whose recordings trained the table, if there are several or one has bad electrodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub people: Vec<Person>,
    /// Errors of the predictions on the test recordings; `None` without test recordings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub figures: Option<SubstitutionFigures>,
}

/// Errors of predicting electrodes from the others. An electrode's error is the mean square of its
/// innovation divided by the mean square of its signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SubstitutionFigures {
    /// Median of the electrodes' errors.
    pub median_nmse: f64,
    /// Largest of the electrodes' errors.
    pub worst_nmse: f64,
    /// Label of the electrode with the largest error.
    pub worst_electrode: String,
}

/// A table that predicts each electrode from all others:
/// `prediction_e = sum_i weight_ei * x_i / 128`. A device compares electrodes with their
/// predictions, and replaces bad electrodes by their predictions.
#[derive(Clone, Debug, PartialEq)]
pub struct SubstitutionTable {
    /// Training and test results.
    pub description: SubstitutionDescription,
    /// Weights, Q7, -127..=127, in the order `[predicted electrode][other electrode]`. An electrode
    /// has the weight 0 for itself.
    pub weights: Vec<i8>,
    /// Typical mean square of each electrode's innovation (the electrode minus its prediction), in
    /// (1/16 uV)^2, 1..=2^26.
    pub innovation: Vec<i32>,
}

impl SubstitutionTable {
    /// Parses both files and checks that they are a table for the montage of `description`.
    pub(crate) fn parse(
        toml: &[u8],
        tensors: &[u8],
        description: &Description,
    ) -> Result<Self, ArtifactError> {
        let file = TensorFile::parse(TENSORS, tensors)?;
        let is_unknown = |name: &&&str| ![WEIGHTS, INNOVATION].contains(*name);
        if let Some(name) = file.names().iter().find(is_unknown) {
            return Err(TensorProblem::Unknown.of(TENSORS, name));
        }
        let electrodes = description.montage.electrodes.len();
        let weights = file.elements(WEIGHTS, Dtype::I8, &[electrodes; 2])?;
        let innovation = file.elements(INNOVATION, Dtype::I32, &[electrodes])?;
        let words = innovation.as_chunks().0.iter();
        let table = Self {
            description: toml::from_slice(toml).map_err(ArtifactError::toml(DESCRIPTION))?,
            weights: weights.iter().map(|byte| byte.cast_signed()).collect(),
            innovation: words.map(|word| i32::from_le_bytes(*word)).collect(),
        };
        table.check(description)?;
        Ok(table)
    }

    /// Returns names and contents of `substitution.toml` and `substitution.safetensors`.
    pub(crate) fn to_files(&self) -> Result<[(&'static str, Vec<u8>); 2], ArtifactError> {
        let electrodes = self.innovation.len();
        let weights = self.weights.iter().map(|weight| weight.cast_unsigned());
        let innovation = self.innovation.iter().flat_map(|word| word.to_le_bytes());
        let tensors = [
            (WEIGHTS, Dtype::I8, vec![electrodes; 2], weights.collect::<Vec<u8>>()),
            (INNOVATION, Dtype::I32, vec![electrodes], innovation.collect()),
        ];
        let description = toml::to_string(&self.description)?.into_bytes();
        Ok([(DESCRIPTION, description), (TENSORS, tensor_file::to_bytes(TENSORS, &tensors)?)])
    }

    /// Checks that the table has the shape of the montage and that all numbers are in their ranges.
    pub(crate) fn check(&self, description: &Description) -> Result<(), ArtifactError> {
        if self.description.format != 1 {
            return Err(ArtifactError::Field {
                file: DESCRIPTION,
                field: "format",
                found: self.description.format.to_string(),
                expected: "1".to_owned(),
            });
        }
        let electrodes = description.montage.electrodes.len();
        for (name, length, shape) in [
            (WEIGHTS, self.weights.len(), &[electrodes; 2][..]),
            (INNOVATION, self.innovation.len(), &[electrodes]),
        ] {
            if length != shape.iter().product::<usize>() {
                let problem = TensorProblem::Shape(vec![length], shape.to_vec());
                return Err(problem.of(TENSORS, name));
            }
        }
        let range =
            |name, index, problem| Err(TensorProblem::Range(index, problem).of(TENSORS, name));
        if let Some(index) = self.weights.iter().position(|&weight| weight == i8::MIN) {
            return range(WEIGHTS, index, "the weight is -128");
        }
        let mut diagonal = (0..electrodes).map(|electrode| electrode * (electrodes + 1));
        if let Some(index) = diagonal.find(|&index| self.weights[index] != 0) {
            return range(WEIGHTS, index, "the electrode predicts itself");
        }
        let mut rows = self.weights.chunks(electrodes.max(1)).enumerate();
        let magnitude = |row: &[i8]| row.iter().map(|w| u32::from(w.unsigned_abs())).sum::<u32>();
        if let Some((row, _)) = rows.find(|(_, row)| magnitude(row) > LARGEST_ROW) {
            let problem = "the magnitudes of the row's weights sum to more than 2,047";
            return range(WEIGHTS, row * electrodes, problem);
        }
        let is_outside = |value: &i32| !(1..=LARGEST_INNOVATION).contains(value);
        match self.innovation.iter().position(is_outside) {
            Some(index) => range(INNOVATION, index, "it is not in 1..=2^26"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
