//! The tensors of a safetensors file, whatever their names, shapes and element types.

use crate::error::ToolError;
use safetensors::{Dtype, SafeTensors};
use std::collections::BTreeMap;
use std::path::Path;

/// Tensors by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct StateDict(BTreeMap<String, Entry>);

/// A tensor of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    /// Lengths of the dimensions.
    pub(super) shape: Vec<usize>,
    /// Element type as in the file, for example `F32`.
    pub(super) element_type: String,
    /// Elements, last dimension fastest; `None` if they are not floats of 32 or 64 bits.
    pub(super) values: Option<Vec<f32>>,
}

impl StateDict {
    /// Reads a file.
    ///
    /// # Errors
    /// If the file cannot be read or is no safetensors file.
    pub(super) fn read(path: &Path) -> Result<Self, ToolError> {
        let bytes = std::fs::read(path).map_err(|source| ToolError::File {
            path: path.to_owned(),
            source,
        })?;
        let file = SafeTensors::deserialize(&bytes).map_err(|source| ToolError::Safetensors {
            path: path.to_owned(),
            source,
        })?;
        let entries = file.iter().map(|(name, view)| {
            let entry = Entry {
                shape: view.shape().to_vec(),
                element_type: view.dtype().to_string(),
                values: floats(view.dtype(), view.data()),
            };
            (name.to_owned(), entry)
        });
        Ok(Self(entries.collect()))
    }

    /// Returns a tensor; `None` if the file has none of this name.
    pub(super) fn get(&self, name: &str) -> Option<&Entry> {
        self.0.get(name)
    }

    /// Iterates over names and tensors, sorted by name.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &Entry)> {
        self.0.iter().map(|(name, entry)| (name.as_str(), entry))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "weights are stored as f32")]
fn floats(element_type: Dtype, bytes: &[u8]) -> Option<Vec<f32>> {
    match element_type {
        Dtype::F32 => {
            let words = bytes.as_chunks().0.iter();
            Some(words.map(|word| f32::from_le_bytes(*word)).collect())
        }
        Dtype::F64 => {
            let words = bytes.as_chunks().0.iter();
            Some(words.map(|word| f64::from_le_bytes(*word) as f32).collect())
        }
        _ => None,
    }
}
