//! Errors in writing a file whose name the user chose.

use std::{io, path::PathBuf};

use thiserror::Error;

/// Why a file cannot be written under the name that the user chose.
#[derive(Debug, Error)]
pub enum NewFileError {
    /// A file with this name exists, and the user did not ask to replace it.
    #[error("{} exists already; choose another name, or replace it with --force", path.display())]
    Exists {
        /// Name that the user chose.
        path: PathBuf,
    },
    /// The chosen name leads, possibly through a link, to a file that the program reads.
    #[error(
        "{} is the input {}; choose another name, because --force replaces no input",
        path.display(),
        input.display()
    )]
    Input {
        /// Name that the user chose.
        path: PathBuf,
        /// Name under which the program reads the file.
        input: PathBuf,
    },
    /// The chosen name is the name of a folder.
    #[error("{} is a folder; write the name of a file in it", path.display())]
    Folder {
        /// Name that the user chose.
        path: PathBuf,
    },
    /// The file cannot be created.
    #[error(
        "{} cannot be created; choose a name in a folder that exists and is writable",
        path.display()
    )]
    Create {
        /// Name that the user chose.
        path: PathBuf,
        /// Error from the operating system.
        source: io::Error,
    },
    /// A part of the file cannot be written.
    #[error("{} cannot be written; make room on the disk and repeat the command", path.display())]
    Write {
        /// Name that the user chose.
        path: PathBuf,
        /// Error from the operating system.
        source: io::Error,
    },
    /// The file has been written, but cannot be renamed from its temporary name, or its bytes may
    /// not have reached the disk. The temporary file is kept.
    #[error(
        "{} cannot be completed; what was written is in {}: check the disk and rename that file",
        path.display(),
        kept.display()
    )]
    Finish {
        /// Name that the user chose.
        path: PathBuf,
        /// Name of the temporary file, which is kept.
        kept: PathBuf,
        /// Error from the operating system.
        source: io::Error,
    },
}
