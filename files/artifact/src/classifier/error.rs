//! Why a classifier cannot be used.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a classifier cannot be read, written or used with a device.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum ClassifierError {
    #[error("cannot read {}; `trainer classify` writes a classifier", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error("the classifier cannot be understood; correct what is named, or train it again")]
    Toml(#[from] toml::de::Error),
    #[error("the classifier cannot be written as TOML")]
    WriteToml(#[from] toml::ser::Error),
    #[error("the classifier's field {field} must be {expected}")]
    Field {
        /// Name of the field, as `table.key`.
        field: &'static str,
        expected: &'static str,
    },
    #[error(
        "the classifier is for {expected}, but the device has {found}; train a classifier with \
         recordings of this montage"
    )]
    Device { expected: String, found: String },
}

impl ClassifierError {
    /// Returns a function that adds the path to an error of the operating system.
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        |source| Self::File { path: path.to_owned(), source }
    }
}
