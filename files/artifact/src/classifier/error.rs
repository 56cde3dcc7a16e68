//! Why a classifier cannot be used.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file is no classifier.
#[derive(Debug, Error)]
pub enum ClassifierError {
    /// The file cannot be read.
    #[error("cannot read {}; `trainer classify` writes a classifier", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error that the operating system returned.
        source: std::io::Error,
    },
    /// The file is not TOML, or a field in it is missing, misspelt or of the wrong type.
    #[error("the classifier cannot be understood; correct what is named, or train it again")]
    Toml(#[from] toml::de::Error),
    /// The TOML library cannot serialise the classifier.
    #[error("the classifier cannot be written as TOML")]
    WriteToml(#[from] toml::ser::Error),
    /// A field has an invalid value.
    #[error("the classifier's field {field} must be {expected}")]
    Field {
        /// Name of the field, as `table.key`.
        field: &'static str,
        /// Values that the field may have, in words.
        expected: &'static str,
    },
    /// The classifier was trained for another device.
    #[error(
        "the classifier is for {expected}, but the device has {found}; train a classifier with \
         recordings of this montage"
    )]
    Device {
        /// What the classifier needs.
        expected: String,
        /// What the device has.
        found: String,
    },
}

impl ClassifierError {
    /// Returns a function that adds the path to an error of the operating system.
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |source| Self::File {
            path: path.to_owned(),
            source,
        }
    }
}
