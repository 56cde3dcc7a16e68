//! Safetensors files whose errors name the file and the tensor.

use crate::error::{ArtifactError, TensorProblem};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};

/// A safetensors file that is being read, with its name for error messages.
pub(crate) struct TensorFile<'f> {
    name: &'static str,
    tensors: SafeTensors<'f>,
}

/// A tensor to write: name, element type, shape, and elements in little-endian order.
pub(crate) type NamedTensor<'n> = (&'n str, Dtype, Vec<usize>, Vec<u8>);

impl<'f> TensorFile<'f> {
    /// Parses the header of a file from its bytes; `name` is for error messages.
    pub(crate) fn parse(name: &'static str, bytes: &'f [u8]) -> Result<Self, ArtifactError> {
        let tensors = SafeTensors::deserialize(bytes)
            .map_err(|source| ArtifactError::Safetensors { file: name, source })?;
        Ok(Self { name, tensors })
    }

    /// Returns the names of all tensors in the file.
    pub(crate) fn names(&self) -> Vec<&str> {
        self.tensors.names()
    }

    /// Returns a tensor, whatever its element type and shape.
    pub(crate) fn tensor(&self, name: &str) -> Result<TensorView<'f>, ArtifactError> {
        self.tensors.tensor(name).map_err(|_| TensorProblem::Missing.of(self.name, name))
    }

    /// Returns the bytes of a tensor, or an error if its elements are not of type `kind`.
    pub(crate) fn bytes(&self, name: &str, kind: Dtype) -> Result<&'f [u8], ArtifactError> {
        let view = self.tensor(name)?;
        if view.dtype() == kind {
            return Ok(view.data());
        }
        let types = [view.dtype(), kind].map(|kind| kind.to_string());
        let [found, expected] = types;
        Err(TensorProblem::ElementType(found, expected).of(self.name, name))
    }

    /// Returns the bytes of a tensor, or an error if its element type or shape differs.
    pub(crate) fn elements(
        &self,
        name: &str,
        kind: Dtype,
        shape: &[usize],
    ) -> Result<&'f [u8], ArtifactError> {
        let bytes = self.bytes(name, kind)?;
        let found = self.tensor(name)?.shape().to_vec();
        if found == shape {
            return Ok(bytes);
        }
        Err(TensorProblem::Shape(found, shape.to_vec()).of(self.name, name))
    }
}

/// Returns the bytes of a safetensors file with these tensors; `name` is for error messages.
pub(crate) fn to_bytes(
    name: &'static str,
    tensors: &[NamedTensor<'_>],
) -> Result<Vec<u8>, ArtifactError> {
    let failed = |source| ArtifactError::Safetensors { file: name, source };
    let views = tensors.iter().map(|(name, kind, shape, bytes)| {
        let view = TensorView::new(*kind, shape.clone(), bytes);
        Ok((*name, view.map_err(failed)?))
    });
    safetensors::serialize(views.collect::<Result<Vec<_>, ArtifactError>>()?, None).map_err(failed)
}
