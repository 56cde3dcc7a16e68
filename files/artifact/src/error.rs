//! Errors of reading, writing and using an artifact.

use std::path::PathBuf;

use crate::list::List;

/// Reason why an artifact cannot be read, written or used.
#[derive(Debug, thiserror::Error)]
pub enum ArtifactError {
    /// A file of the folder cannot be read or written.
    #[error("cannot access {}: is this the folder of an artifact? (`trainer train` writes one)", path.display())]
    File {
        /// File or folder that was accessed.
        path: PathBuf,
        /// Error from the operating system.
        source: std::io::Error,
    },
    /// `model.toml` is not TOML, or a field is missing, misspelt or of the wrong type.
    #[error(
        "model.toml cannot be understood; correct what is named, or restore the file if it is cut short"
    )]
    Toml(#[from] toml::de::Error),
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
    /// A field of `model.toml` has an invalid value.
    #[error("model.toml: {field} is {found}, but must be {expected}")]
    Field {
        /// Name of the field, as `table.key`.
        field: &'static str,
        /// Value in the file.
        found: String,
        /// Valid values, in words.
        expected: String,
    },
    /// One of the two files of a packed model is missing.
    #[error(
        "{} is missing, which {} needs; restore it, or delete the other one too and run `trainer packed`",
        missing.display(),
        other
    )]
    PackedHalf {
        /// Path of the missing file.
        missing: PathBuf,
        /// Name of the file that is there.
        other: &'static str,
    },
    /// `packed.toml` is not TOML, or a field is missing, misspelt or of the wrong type.
    #[error(
        "packed.toml cannot be understood; correct what is named, or restore the file if it is cut short"
    )]
    PackedToml(#[source] toml::de::Error),
    /// A field of `packed.toml` has an invalid value.
    #[error("packed.toml: {field} is {found}, but must be {expected}")]
    PackedField {
        /// Name of the field.
        field: &'static str,
        /// Value in the file.
        found: String,
        /// Valid values, in words.
        expected: String,
    },
    /// An electrode label is malformed, occurs twice, or is only on the grid or only in the montage.
    #[error(
        "model.toml: electrode {label}: {problem}; grid.cells and montage.electrodes must hold the same labels, each once"
    )]
    Label {
        /// Label of the electrode, as in the file.
        label: String,
        /// Problem in words, which continue a sentence that begins with the label.
        problem: &'static str,
    },
    /// A tensor that the model's mode requires is missing.
    #[error("{file}: tensor {name} is missing; a model of this mode needs it")]
    MissingTensor {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the tensor, as in the file.
        name: String,
    },
    /// The file holds a tensor that no model of this mode has; its name may be misspelt.
    #[error("{file}: tensor {name} is not part of a model of this mode; rename or remove it")]
    UnknownTensor {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the tensor, as in the file.
        name: String,
    },
    /// A tensor has another shape than mode, padding and pool of the model require.
    #[error("{file}: tensor {name} has shape {}, expected {}", List(.found), List(.expected))]
    Shape {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the tensor, as in the file.
        name: String,
        /// Shape of the tensor in the file.
        found: Vec<usize>,
        /// Shape that mode, padding and pool of the model require.
        expected: Vec<usize>,
    },
    /// A tensor has another element type than the format requires.
    #[error(
        "{file}: tensor {name} has elements of type {found}, expected {expected}; convert it before writing"
    )]
    ElementType {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the tensor, as in the file.
        name: String,
        /// Element type of the tensor in the file.
        found: String,
        /// Element type that the format requires.
        expected: &'static str,
    },
    /// An element is infinite or NaN, probably because training diverged.
    #[error("{file}: tensor {name}, element {index}, is {value}; train again with a lower rate")]
    NotFinite {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the tensor, as in the file.
        name: String,
        /// Index of the first offending element, last dimension fastest.
        index: usize,
        /// Value of the offending element, infinite or NaN.
        value: f32,
    },
    /// A calibrated range is empty or a variance is negative.
    #[error("{file}: tensor {name}, element {index}: {problem}; calibrate or train again")]
    Range {
        /// Name of the file in the artifact's folder.
        file: &'static str,
        /// Name of the tensor, as in the file.
        name: String,
        /// Index of the first offending element, last dimension fastest.
        index: usize,
        /// Problem in words, for the message.
        problem: &'static str,
    },
    /// The model has mode `paper`, whose decoder needs pool indices, which are not in the code.
    #[error(
        "a model of mode `paper` cannot be decoded from its code: its pool indices are not sent; use `paper-code-only` or `shortcut`"
    )]
    NotDecodable,
    /// The model has mode `packed`, but no packed model.
    #[error(
        "the model has mode `packed`, but no packed.toml and packed.safetensors; `trainer packed --montage` writes them"
    )]
    Empty,
}
