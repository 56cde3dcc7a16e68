//! Errors of reading, writing and using an artifact.

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

/// Reason why an artifact cannot be read, written or used.
#[derive(Debug, thiserror::Error)]
pub enum ArtifactError {
    /// A file of the folder cannot be read or written.
    #[error("cannot access {}: is this the folder of an artifact? (`trainer train` writes one)", path.display())]
    File {
        /// File or folder that was accessed.
        path: PathBuf,
        /// Error that the operating system returned.
        source: std::io::Error,
    },
    /// A file is not TOML, or a field in it is missing, misspelt or of the wrong type.
    #[error(
        "{file} cannot be understood; correct what is named, or restore the file if it is cut short"
    )]
    Toml {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Position and kind of the error in the file.
        source: Box<toml::de::Error>,
    },
    /// The TOML library cannot serialise the description.
    #[error("the description cannot be written as TOML")]
    WriteToml(#[from] toml::ser::Error),
    /// A file is damaged or not in the safetensors format.
    #[error("{file} is damaged or not a safetensors file; write the artifact again")]
    Safetensors {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Error from the safetensors library.
        source: safetensors::SafeTensorError,
    },
    /// A field of a TOML file has an invalid value.
    #[error("{file}: {field} is {found}, but must be {expected}")]
    Field {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the field, as `table.key`.
        field: &'static str,
        /// Description of the values that the field may have.
        found: String,
        /// Values that the field may have, in words.
        expected: String,
    },
    /// Only one of the two files of a packed model, or of a table of substitutions, exists.
    #[error(
        "{} is missing, which {other} needs; restore it, or delete the other one too and run `trainer {command}`",
        missing.display()
    )]
    Half {
        /// Path of the missing file.
        missing: PathBuf,
        /// Name of the file that exists.
        other: &'static str,
        /// Command of the trainer that writes both files.
        command: &'static str,
    },
    /// An electrode label is malformed, occurs twice, or is missing on the grid or in the montage.
    #[error(
        "model.toml: electrode {label}: {problem}; grid.cells and montage.electrodes must hold the same labels, each once"
    )]
    Label {
        /// Label of the electrode, as the file has it.
        label: String,
        /// Description of the problem, which the message puts after the label.
        problem: &'static str,
    },
    /// A tensor is missing, unknown, or not as the model requires.
    #[error("{file}: tensor {name}{problem}")]
    Tensor {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the tensor, as in the file.
        name: String,
        /// How the tensor differs from what the model requires.
        problem: TensorProblem,
    },
    /// The model has mode `paper`, whose decoder needs pool indices, and codes carry none.
    #[error(
        "a model of mode `paper` cannot be decoded from its code: its pool indices are not sent; use `paper-code-only` or `shortcut`"
    )]
    NotDecodable,
    /// The model has mode `packed`, but its folder has no packed model.
    #[error(
        "the model has mode `packed`, but no packed.toml and packed.safetensors; `trainer packed --montage` writes them"
    )]
    Empty,
}

/// How a tensor differs from what the model's mode, padding and pool require.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TensorProblem {
    /// The file does not hold the tensor.
    #[error(" is missing; a model of this mode needs it")]
    Missing,
    /// No model of this mode has the tensor; its name may be misspelt.
    #[error(" is not part of a model of this mode; rename or remove it")]
    Unknown,
    /// The tensor has the first of these shapes, but should have the second.
    #[error(" has shape {}, expected {}", List(.0), List(.1))]
    Shape(Vec<usize>, Vec<usize>),
    /// The tensor has elements of the first of these types, but should have the second.
    #[error(" has elements of type {0}, expected {1}; convert it before writing")]
    ElementType(String, String),
    /// An element is infinite or NaN, probably because training diverged. The fields are its index
    /// in the flat tensor, last dimension fastest, and its value.
    #[error(", element {0}, is {1}; train again with a lower rate")]
    NotFinite(usize, f32),
    /// A calibrated range is empty, a variance is negative, or a sum could overflow. The fields are
    /// the index of the first such element, last dimension fastest, and the problem in words.
    #[error(", element {0}: {1}; calibrate or train again")]
    Range(usize, &'static str),
}

impl ArtifactError {
    /// Returns the error with the folder before the name of a file that cannot be accessed.
    pub(crate) fn in_folder(mut self, folder: &Path) -> Self {
        if let Self::File { path, .. } | Self::Half { missing: path, .. } = &mut self {
            *path = folder.join(&path);
        }
        self
    }

    /// Returns a function that adds the name of the file to an error of the TOML library.
    pub(crate) fn toml(file: &'static str) -> impl FnOnce(toml::de::Error) -> Self {
        move |source| Self::Toml {
            file,
            source: Box::new(source),
        }
    }

    /// Returns a function that adds the path to an error of the operating system.
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |source| Self::File {
            path: path.to_owned(),
            source,
        }
    }
}

impl TensorProblem {
    pub(crate) fn of(self, file: &'static str, name: &str) -> ArtifactError {
        ArtifactError::Tensor {
            file,
            name: name.to_owned(),
            problem: self,
        }
    }
}

/// Displays a list as TOML writes it: `[2, 2, 1]`.
#[derive(Clone, Copy, Debug)]
pub struct List<'e, T>(pub &'e [T]);

impl<T: Display> Display for List<'_, T> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str("[")?;
        for (index, element) in self.0.iter().enumerate() {
            let separator = if index > 0 { ", " } else { "" };
            write!(formatter, "{separator}{element}")?;
        }
        formatter.write_str("]")
    }
}
