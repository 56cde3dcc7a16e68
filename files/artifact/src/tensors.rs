//! The f32 tensors of one file of an artifact.

use crate::error::{ArtifactError, TensorProblem};
use crate::shapes::NamedShape;
use crate::tensor_file::{self, TensorFile};
use safetensors::tensor::Dtype;
use std::collections::BTreeMap;

/// Name of the file that holds the weights.
pub(crate) const WEIGHTS: &str = "weights.safetensors";
/// Name of the file that holds the calibrated ranges.
pub(crate) const CALIBRATION: &str = "calibration.safetensors";
/// Name of the file that holds the PCA of the training windows.
pub(crate) const PCA: &str = "pca.safetensors";

/// The f32 tensors of one `.safetensors` file of an artifact, by name.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensors {
    file: &'static str,
    tensors: BTreeMap<String, (Vec<usize>, Vec<f32>)>,
}

impl Tensors {
    /// Creates an empty set of tensors for `weights.safetensors`.
    pub fn for_weights() -> Self {
        Self::new(WEIGHTS)
    }

    /// Creates an empty set of tensors for `calibration.safetensors`.
    pub fn for_calibration() -> Self {
        Self::new(CALIBRATION)
    }

    /// Creates an empty set of tensors for `pca.safetensors`.
    pub(crate) fn for_pca() -> Self {
        Self::new(PCA)
    }

    fn new(file: &'static str) -> Self {
        Self { file, tensors: BTreeMap::new() }
    }

    /// Inserts a tensor, or replaces the tensor of the same name.
    ///
    /// # Panics
    /// If the number of `values` is not the product of `shape`.
    pub fn insert(&mut self, name: &str, shape: &[usize], values: Vec<f32>) {
        assert_eq!(
            values.len(),
            shape.iter().product::<usize>(),
            "{name} does not fill its shape {shape:?}"
        );
        self.tensors.insert(name.to_owned(), (shape.to_vec(), values));
    }

    /// Returns the elements of a tensor, last dimension fastest.
    ///
    /// # Errors
    /// If there is no tensor of this name, or its shape differs.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<&[f32], ArtifactError> {
        let tensor = self.tensors.get(name);
        let (found, values) = tensor.ok_or_else(|| TensorProblem::Missing.of(self.file, name))?;
        if found != shape {
            return Err(TensorProblem::Shape(found.clone(), shape.to_vec()).of(self.file, name));
        }
        Ok(values)
    }

    /// Returns name and shape of every tensor, sorted by name.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[usize])> {
        self.tensors.iter().map(|(name, (shape, _))| (name.as_str(), shape.as_slice()))
    }

    /// Returns an error if an expected tensor is missing or has another shape, a tensor is
    /// unexpected, or a number is not finite.
    pub(crate) fn check(&self, expected: &[NamedShape]) -> Result<(), ArtifactError> {
        for (name, shape) in expected {
            let values = self.tensor(name, shape)?;
            if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                return Err(TensorProblem::NotFinite(index, values[index]).of(self.file, name));
            }
        }
        let is_unknown = |name: &&String| !expected.iter().any(|(known, _)| known == name);
        match self.tensors.keys().find(is_unknown) {
            None => Ok(()),
            Some(name) => Err(TensorProblem::Unknown.of(self.file, name)),
        }
    }

    pub(crate) fn range_error(
        &self,
        name: &str,
        index: usize,
        problem: &'static str,
    ) -> ArtifactError {
        TensorProblem::Range(index, problem).of(self.file, name)
    }

    pub(crate) fn from_bytes(file: &'static str, bytes: &[u8]) -> Result<Self, ArtifactError> {
        let read = TensorFile::parse(file, bytes)?;
        let mut tensors = Self::new(file);
        for name in read.names() {
            let (words, _) = read.bytes(name, Dtype::F32)?.as_chunks();
            let values = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
            tensors.insert(name, read.tensor(name)?.shape(), values);
        }
        Ok(tensors)
    }

    pub(crate) fn to_bytes(&self) -> Result<Vec<u8>, ArtifactError> {
        let tensors = self.tensors.iter().map(|(name, (shape, values))| {
            let bytes = values.iter().flat_map(|value| value.to_le_bytes());
            (name.as_str(), Dtype::F32, shape.clone(), bytes.collect())
        });
        tensor_file::to_bytes(self.file, &tensors.collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that `result` is an error that reports the problem `expected` of the tensor `name`.
    fn assert_problem<T: std::fmt::Debug>(
        result: Result<T, ArtifactError>,
        name: &str,
        expected: &TensorProblem,
    ) {
        let error = result.unwrap_err();
        let text = error.to_string();
        let ArtifactError::Tensor { name: found, problem, .. } = error else { panic!("{text}") };
        assert_eq!((found.as_str(), &problem), (name, expected));
    }

    #[test]
    fn the_error_of_a_wrong_element_type_names_the_tensor() {
        let tensors = [("a", Dtype::I8, vec![2], vec![1, 2])];
        let bytes = tensor_file::to_bytes(WEIGHTS, &tensors).unwrap();
        let expected = TensorProblem::ElementType("I8".to_owned(), "F32".to_owned());
        assert_problem(Tensors::from_bytes(WEIGHTS, &bytes), "a", &expected);
    }

    #[test]
    fn missing_unknown_misshapen_and_not_finite_tensors_are_refused() {
        let mut tensors = Tensors::for_calibration();
        let expected: &[NamedShape] = &[("a", vec![2])];
        assert_problem(tensors.check(expected), "a", &TensorProblem::Missing);
        tensors.insert("a", &[3], vec![0.0; 3]);
        let shape = TensorProblem::Shape(vec![3], vec![2]);
        assert_problem(tensors.check(expected), "a", &shape);
        tensors.insert("a", &[2], vec![0.0, f32::INFINITY]);
        let infinite = TensorProblem::NotFinite(1, f32::INFINITY);
        assert_problem(tensors.check(expected), "a", &infinite);
        tensors.insert("a", &[2], vec![0.0, f32::NAN]);
        assert!(tensors.check(expected).is_err());
        tensors.insert("a", &[2], vec![0.0, 1.0]);
        tensors.check(expected).unwrap();
        tensors.insert("typo", &[1], vec![0.0]);
        assert_problem(tensors.check(expected), "typo", &TensorProblem::Unknown);
    }
}
