//! The tensors of one file.

use crate::error::ArtifactError;
use crate::shapes::NamedShape;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::BTreeMap;

/// Name of the file that holds the weights.
pub(crate) const WEIGHTS: &str = "weights.safetensors";
/// Name of the file that holds the calibrated ranges.
pub(crate) const CALIBRATION: &str = "calibration.safetensors";
/// Name of the file that holds the PCA of the training windows.
pub(crate) const PCA: &str = "pca.safetensors";

/// The f32 tensors of one `.safetensors` file, by name.
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
        Self {
            file,
            tensors: BTreeMap::new(),
        }
    }

    /// Inserts a tensor, or replaces the one of the same name.
    ///
    /// # Panics
    /// If the number of `values` is not the product of `shape`.
    pub fn insert(&mut self, name: &str, shape: &[usize], values: Vec<f32>) {
        assert_eq!(
            values.len(),
            shape.iter().product::<usize>(),
            "{name} does not fill its shape {shape:?}"
        );
        self.tensors
            .insert(name.to_owned(), (shape.to_vec(), values));
    }

    /// Returns the elements of a tensor, last dimension fastest.
    ///
    /// # Errors
    /// If there is no tensor of this name, or its shape differs.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<&[f32], ArtifactError> {
        let (found, values) =
            self.tensors
                .get(name)
                .ok_or_else(|| ArtifactError::MissingTensor {
                    file: self.file,
                    name: name.to_owned(),
                })?;
        if found != shape {
            return Err(ArtifactError::Shape {
                file: self.file,
                name: name.to_owned(),
                found: found.clone(),
                expected: shape.to_vec(),
            });
        }
        Ok(values)
    }

    /// Returns name and shape of every tensor, sorted by name.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[usize])> {
        self.tensors
            .iter()
            .map(|(name, (shape, _))| (name.as_str(), shape.as_slice()))
    }

    /// Returns an error if a tensor is missing, unknown or of another shape, or a number is not finite.
    pub(crate) fn check(&self, expected: &[NamedShape]) -> Result<(), ArtifactError> {
        for (name, shape) in expected {
            let values = self.tensor(name, shape)?;
            if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                return Err(ArtifactError::NotFinite {
                    file: self.file,
                    name: (*name).to_owned(),
                    index,
                    value: values[index],
                });
            }
        }
        match self
            .tensors
            .keys()
            .find(|name| !expected.iter().any(|(known, _)| known == name))
        {
            None => Ok(()),
            Some(name) => Err(ArtifactError::UnknownTensor {
                file: self.file,
                name: name.clone(),
            }),
        }
    }

    pub(crate) fn range_error(
        &self,
        name: &str,
        index: usize,
        problem: &'static str,
    ) -> ArtifactError {
        ArtifactError::Range {
            file: self.file,
            name: name.to_owned(),
            index,
            problem,
        }
    }

    pub(crate) fn from_bytes(file: &'static str, bytes: &[u8]) -> Result<Self, ArtifactError> {
        let read = SafeTensors::deserialize(bytes)
            .map_err(|source| ArtifactError::Safetensors { file, source })?;
        let mut tensors = Self::new(file);
        for (name, view) in read.iter() {
            if view.dtype() != Dtype::F32 {
                return Err(ArtifactError::ElementType {
                    file,
                    name: name.to_owned(),
                    found: view.dtype().to_string(),
                    expected: "F32",
                });
            }
            let (words, _) = view.data().as_chunks();
            let values = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
            tensors.insert(name, view.shape(), values);
        }
        Ok(tensors)
    }

    pub(crate) fn to_bytes(&self) -> Result<Vec<u8>, ArtifactError> {
        let error = |source| ArtifactError::Safetensors {
            file: self.file,
            source,
        };
        let bytes: Vec<Vec<u8>> = self
            .tensors
            .values()
            .map(|(_, values)| {
                values
                    .iter()
                    .flat_map(|value| value.to_le_bytes())
                    .collect()
            })
            .collect();
        let mut views = Vec::with_capacity(bytes.len());
        for ((name, (shape, _)), bytes) in self.tensors.iter().zip(&bytes) {
            views.push((
                name,
                TensorView::new(Dtype::F32, shape.clone(), bytes).map_err(error)?,
            ));
        }
        safetensors::serialize(views, None).map_err(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn serialised_tensors_read_back_equal() {
        let mut tensors = Tensors::for_weights();
        tensors.insert(
            "b",
            &[2, 3],
            vec![0.0, -1.5, 2.0, f32::MIN_POSITIVE, 4.0, 5.0],
        );
        tensors.insert("a", &[1], vec![0.1]);
        let bytes = tensors.to_bytes().unwrap();
        assert_eq!(Tensors::from_bytes(WEIGHTS, &bytes).unwrap(), tensors);
    }

    #[test]
    fn the_error_of_a_wrong_element_type_names_the_tensor() {
        let bytes = safetensors::serialize(
            [("a", TensorView::new(Dtype::I8, vec![2], &[1, 2]).unwrap())],
            None,
        )
        .unwrap();
        let error = Tensors::from_bytes(WEIGHTS, &bytes).unwrap_err();
        assert!(matches!(error, ArtifactError::ElementType { ref name, .. } if name == "a"));
    }

    #[test]
    fn bytes_in_another_format_are_refused() {
        let error = Tensors::from_bytes(WEIGHTS, b"not one").unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("weights.safetensors is damaged")
        );
    }

    #[test]
    fn missing_unknown_misshapen_and_not_finite_tensors_are_refused() {
        let mut tensors = Tensors::for_calibration();
        let expected: &[NamedShape] = &[("a", vec![2])];
        assert!(matches!(
            tensors.check(expected),
            Err(ArtifactError::MissingTensor { ref name, .. }) if name == "a"
        ));
        tensors.insert("a", &[3], vec![0.0; 3]);
        assert!(matches!(
            tensors.check(expected),
            Err(ArtifactError::Shape { .. })
        ));
        tensors.insert("a", &[2], vec![0.0, f32::NAN]);
        assert!(matches!(
            tensors.check(expected),
            Err(ArtifactError::NotFinite { index: 1, .. })
        ));
        tensors.insert("a", &[2], vec![0.0, 1.0]);
        tensors.check(expected).unwrap();
        tensors.insert("typo", &[1], vec![0.0]);
        assert!(matches!(
            tensors.check(expected),
            Err(ArtifactError::UnknownTensor { ref name, .. }) if name == "typo"
        ));
    }
}
