//! Errors of encoding, decoding and comparing.

use std::{io, path::PathBuf};

use artifact::{ArtifactError, ModelId};
use new_file::NewFileError;
use picture::canvas::PictureError;
use recordings::{MontageMapError, RecordingError};
use thiserror::Error;

use crate::code_file::CodeFileError;

/// Why a file could not be encoded, decoded or compared. A path names the file that failed.
#[derive(Debug, Error)]
pub enum OfflineError {
    /// The recording cannot be read.
    #[error("{} cannot be read", .0.display())]
    Recording(PathBuf, #[source] RecordingError),
    /// The recording does not fit the model's montage.
    #[error("{} cannot be encoded", .0.display())]
    Montage(PathBuf, #[source] MontageMapError),
    /// The file of codes cannot be decoded.
    #[error("{} cannot be decoded", .0.display())]
    Codes(PathBuf, #[source] CodeFileError),
    /// Packed blocks were asked for, but the built-in model has no packed code. Holds the model's
    /// id.
    #[error(
        "model {0} has no packed code, so there are no packed blocks to write; add one with \
         `trainer packed` and build this program with that model, or write codes"
    )]
    NoPackedCode(ModelId),
    /// Codes were asked for, but the built-in model has no network. Holds the model's id.
    #[error(
        "model {0} has no network, so there are no codes to write; write packed blocks, with \
         --stream packed"
    )]
    NoNetwork(ModelId),
    /// The model in this folder cannot decode codes.
    #[error("the model in {} cannot decode codes", .0.display())]
    Model(PathBuf, #[source] ArtifactError),
    /// The program cannot filter the original recording for the model of the codes, because it was
    /// built with another model.
    #[error(
        "{path} cannot be compared with codes of model {1}, because this program was built with another \
         one; build it with CORTICODE_ARTIFACT, the absolute path of the model's folder, or leave out \
         --original",
        path = .0.display()
    )]
    OtherOriginal(PathBuf, ModelId),
    /// The name of an output cannot be used, or the output cannot be created or completed.
    #[error(transparent)]
    NewFile(#[from] NewFileError),
    /// An output cannot be written, because the operating system or the format's writer refuses.
    #[error("{} cannot be written; is the disk full?", .0.display())]
    Write(PathBuf, #[source] io::Error),
    /// The format cannot hold the signal, or needs a regular file as the output.
    #[error(
        "{} cannot hold the signal in this format; choose another one with --to, or a regular file",
        .0.display()
    )]
    Format(PathBuf, #[source] io::Error),
    /// A picture cannot be written.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The user ended the program.
    #[error("interrupted; unfinished files were deleted")]
    Interrupted,
}

impl OfflineError {
    /// Returns a closure that converts an error from writing to `path`: to [`Self::Format`] if the
    /// format does not fit the signal or the output, otherwise to [`Self::Write`].
    pub(crate) fn write(path: &std::path::Path) -> impl Fn(io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |error| match error.kind() {
            io::ErrorKind::InvalidInput | io::ErrorKind::NotSeekable => {
                Self::Format(path.clone(), error)
            }
            _ => Self::Write(path.clone(), error),
        }
    }

    /// Returns the exit status of a program: 1 if writing an output failed or the user ended the
    /// program; 2 if an input, the name of an output or the format of an output cannot be used.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Write(..)
            | Self::Picture(_)
            | Self::Interrupted
            | Self::NewFile(NewFileError::Finish { .. }) => 1,
            _ => 2,
        }
    }
}
