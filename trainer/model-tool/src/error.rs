//! Errors of reading, comparing and importing models.

use std::path::PathBuf;

/// Reason why a model cannot be shown, compared, checked or imported.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// A file cannot be read.
    #[error("cannot read {}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error from the operating system.
        source: std::io::Error,
    },
    /// A folder holds no usable model.
    #[error("{} holds no usable model", folder.display())]
    Artifact {
        /// Folder that was read.
        folder: PathBuf,
        /// What is wrong with the files.
        source: Box<artifact::ArtifactError>,
    },
    /// A model cannot be turned into integers.
    #[error("the model in {} cannot be turned into integers", folder.display())]
    Integers {
        /// Folder of the model.
        folder: PathBuf,
        /// What does not fit.
        source: Box<model_gen::ModelGenError>,
    },
    /// The recordings of a check cannot be used.
    #[error("the model cannot be checked on these recordings")]
    Recordings(#[source] Box<trainer::error::TrainerError>),
    /// The specification of an import is not TOML, or a field is missing, misspelt or of the wrong type.
    #[error("{} is no specification of an import; docs/importing.md has an example", path.display())]
    Spec {
        /// Path of the file.
        path: PathBuf,
        /// Place and kind of the error.
        source: Box<toml::de::Error>,
    },
    /// The specification describes a model that cannot exist.
    #[error("{} describes no possible model", path.display())]
    Shape {
        /// Path of the file.
        path: PathBuf,
        /// What is impossible.
        source: Box<trainer::error::TrainerError>,
    },
    /// The file with the weights is damaged or of another format.
    #[error(
        "{} is damaged or no safetensors file; export it again, with `safetensors.torch.save_file`",
        path.display()
    )]
    Safetensors {
        /// Path of the file.
        path: PathBuf,
        /// Error from the safetensors library.
        source: safetensors::SafeTensorError,
    },
    /// The tensors of a file have the right shapes, but are no usable model.
    #[error("the tensors of {} are no usable model", path.display())]
    Unusable {
        /// File with the tensors.
        path: PathBuf,
        /// What is wrong.
        source: Box<trainer::error::TrainerError>,
    },
    /// Tensors of the file are not those of the model that the specification describes.
    #[error("{} and {} do not fit together:\n  {}", tensors.display(), spec.display(), mistakes.join("\n  "))]
    Mistakes {
        /// File with the tensors.
        tensors: PathBuf,
        /// The specification.
        spec: PathBuf,
        /// Every mistake, in a line each.
        mistakes: Vec<String>,
    },
    /// The network of this project and the exported one compute different values from the same weights.
    #[error(
        "{what} {index} of the reference differs by {difference:.3e} in element {element}, more than {tolerance:.0e} of \
         the RMS of all {what}s ({rms:.3e}): the exported network is not the one that the specification describes \
         (order of layers, padding, pool, training mode instead of `eval()`), or the reference is of other weights"
    )]
    Reference {
        /// `code` or `reconstruction`.
        what: &'static str,
        /// Index of the window.
        index: usize,
        /// Index of the element with the largest difference.
        element: usize,
        /// Largest difference.
        difference: f32,
        /// Root mean square of all reference values.
        rms: f32,
        /// Largest difference that is accepted, relative to the RMS.
        tolerance: f32,
    },
    /// The output folder holds a model.
    #[error("{} holds a model already; choose another folder, or replace it with --force", folder.display())]
    Exists {
        /// Output folder.
        folder: PathBuf,
    },
    /// The artifact cannot be written.
    #[error("cannot write the model to {}", folder.display())]
    Write {
        /// Output folder.
        folder: PathBuf,
        /// What is wrong.
        source: Box<artifact::ArtifactError>,
    },
}
