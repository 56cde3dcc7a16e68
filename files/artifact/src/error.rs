//! Errors of reading, writing and using an artifact.

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

/// Reason why an artifact cannot be read, written or used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum ArtifactError {
    #[error("cannot access {}: is this the folder of an artifact? (`trainer train` writes one)", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error(
        "{file} cannot be understood; correct what is named, or restore the file if it is cut short"
    )]
    Toml { file: &'static str, source: Box<toml::de::Error> },
    #[error("the description cannot be written as TOML")]
    WriteToml(#[from] toml::ser::Error),
    #[error("{file} is damaged or not a safetensors file; write the artifact again")]
    Safetensors { file: &'static str, source: safetensors::SafeTensorError },
    #[error("{file}: {field} is {found}, but must be {expected}")]
    Field {
        file: &'static str,
        /// Name of the field, as `table.key`.
        field: &'static str,
        found: String,
        expected: String,
    },
    /// Only one of the two files of a packed model, or of a substitution table, exists.
    #[error(
        "{} is missing, which {other} needs; restore it, or delete the other one too and run `trainer {command}`",
        missing.display()
    )]
    Half { missing: PathBuf, other: &'static str, command: &'static str },
    #[error(
        "model.toml: electrode {label}: {problem}; grid.cells and montage.electrodes must hold the same labels, each once"
    )]
    Label { label: String, problem: &'static str },
    #[error("{file}: tensor {name}{problem}")]
    Tensor { file: &'static str, name: String, problem: TensorProblem },
    #[error(
        "a model of mode `paper` cannot be decoded from its code: its pool indices are not sent; use `paper-code-only` or `shortcut`"
    )]
    NotDecodable,
    #[error(
        "the model has mode `packed`, but no packed.toml and packed.safetensors; `trainer packed --montage` writes them"
    )]
    Empty,
}

/// How a tensor differs from what the model's mode, padding and pool require.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum TensorProblem {
    #[error(" is missing; a model of this mode needs it")]
    Missing,
    #[error(" is not part of a model of this mode; rename or remove it")]
    Unknown,
    #[error(" has shape {}, expected {}", List(.0), List(.1))]
    Shape(Vec<usize>, Vec<usize>),
    #[error(" has elements of type {0}, expected {1}; convert it before writing")]
    ElementType(String, String),
    /// An element is infinite or NaN, probably because training diverged. The fields are its index
    /// in the flat tensor (last dimension fastest) and its value.
    #[error(", element {0}, is {1}; train again with a lower rate")]
    NotFinite(usize, f32),
    /// A calibrated range is empty, a variance is negative, or a sum could overflow. The fields are
    /// the index of the first such element (last dimension fastest) and the problem in words.
    #[error(", element {0}: {1}; calibrate or train again")]
    Range(usize, &'static str),
}

impl ArtifactError {
    /// Returns the error with `folder` before the path of the file that is missing or inaccessible.
    pub(crate) fn in_folder(mut self, folder: &Path) -> Self {
        if let Self::File { path, .. } | Self::Half { missing: path, .. } = &mut self {
            *path = folder.join(&path);
        }
        self
    }

    /// Returns a function that adds the file's name to an error of the TOML library.
    pub(crate) fn toml(file: &'static str) -> impl FnOnce(toml::de::Error) -> Self {
        move |source| Self::Toml { file, source: Box::new(source) }
    }

    /// Returns a function that adds the path to an error of the operating system.
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |source| Self::File { path: path.to_owned(), source }
    }
}

impl TensorProblem {
    pub(crate) fn of(self, file: &'static str, name: &str) -> ArtifactError {
        ArtifactError::Tensor { file, name: name.to_owned(), problem: self }
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
