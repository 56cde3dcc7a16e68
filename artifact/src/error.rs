use std::path::PathBuf;

/// Why an artifact cannot be read, written or used.
#[derive(Debug, thiserror::Error)]
pub enum ArtifactError {
    /// A file of the folder cannot be read or written.
    #[error("cannot access {}: is this the folder of an artifact? (`trainer train` writes one)", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// `model.toml` is not TOML, or a field is missing, misspelt or of the wrong type.
    #[error("model.toml cannot be understood; correct the line that is named")]
    Toml(#[from] toml::de::Error),
    /// A description cannot be written as TOML.
    #[error("the description cannot be written as TOML")]
    WriteToml(#[from] toml::ser::Error),
    /// A `.safetensors` file is damaged or is no such file.
    #[error("{file} is damaged or no safetensors file; write the artifact again")]
    Safetensors {
        /// The file's name in the folder.
        file: &'static str,
        /// What the reader said.
        source: safetensors::SafeTensorError,
    },
    /// A field of `model.toml` has a value that no model can have.
    #[error("model.toml: {field} is {found}, but must be {expected}")]
    Field {
        /// The field, as `table.key`.
        field: &'static str,
        /// The value that was found.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// A label of the grid that is not in the montage, the other way round, or twice.
    #[error(
        "model.toml: electrode {label}: {problem}; grid.cells and montage.electrodes must hold the same labels, each once"
    )]
    Label {
        /// The label.
        label: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A tensor that the mode needs is not there.
    #[error("{file}: tensor {name} is missing; a model of this mode needs it")]
    MissingTensor {
        /// The file's name in the folder.
        file: &'static str,
        /// The tensor's name.
        name: String,
    },
    /// A tensor that no model of this mode has: perhaps a misspelt name.
    #[error("{file}: tensor {name} is not part of a model of this mode; rename or remove it")]
    UnknownTensor {
        /// The file's name in the folder.
        file: &'static str,
        /// The tensor's name.
        name: String,
    },
    /// A tensor has another shape.
    #[error("{file}: tensor {name} has shape {found:?}, expected {expected:?}")]
    Shape {
        /// The file's name in the folder.
        file: &'static str,
        /// The tensor's name.
        name: String,
        /// The shape in the file.
        found: Vec<usize>,
        /// The shape that the network has.
        expected: Vec<usize>,
    },
    /// A tensor has another element type.
    #[error(
        "{file}: tensor {name} has elements of type {found}, expected {expected}; convert it before writing"
    )]
    ElementType {
        /// The file's name in the folder.
        file: &'static str,
        /// The tensor's name.
        name: String,
        /// The type in the file.
        found: String,
        /// The type that the format has.
        expected: &'static str,
    },
    /// A number that is infinite or not a number: training diverged.
    #[error("{file}: tensor {name}, element {index}, is {value}; train again with a lower rate")]
    NotFinite {
        /// The file's name in the folder.
        file: &'static str,
        /// The tensor's name.
        name: String,
        /// Index of the first such element.
        index: usize,
        /// The element.
        value: f32,
    },
    /// A range or variance that is empty or negative.
    #[error("{file}: tensor {name}, element {index}: {problem}; calibrate or train again")]
    Range {
        /// The file's name in the folder.
        file: &'static str,
        /// The tensor's name.
        name: String,
        /// Index of the first such element.
        index: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Mode `paper` unpools with indices that are not in the code.
    #[error(
        "a model of mode `paper` cannot be decoded from its code: its pool indices are not sent; use `paper-code-only` or `shortcut`"
    )]
    NotDecodable,
}
