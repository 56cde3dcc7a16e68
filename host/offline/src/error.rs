//! Errors of encoding, decoding and comparing.

use std::{io, path::PathBuf};

use artifact::{ArtifactError, ModelId};
use new_file::NewFileError;
use picture::canvas::PictureError;
use recordings::{MontageMapError, RecordingError};
use thiserror::Error;

use crate::code_file::CodeFileError;

/// Why a file could not be encoded, decoded or compared.
#[derive(Debug, Error)]
pub enum OfflineError {
    /// The recording cannot be read.
    #[error("{} cannot be read", path.display())]
    Recording {
        /// Name of the recording.
        path: PathBuf,
        /// Error of its reader.
        source: RecordingError,
    },
    /// The recording does not fit the model's montage.
    #[error("{} cannot be encoded", path.display())]
    Montage {
        /// Name of the recording.
        path: PathBuf,
        /// What does not fit.
        source: MontageMapError,
    },
    /// The file of codes cannot be decoded.
    #[error("{} cannot be decoded", path.display())]
    Codes {
        /// Name of the file.
        path: PathBuf,
        /// What is wrong with it.
        source: CodeFileError,
    },
    /// Packed blocks are wanted, and the model has no packed code.
    #[error(
        "model {model} has no packed code, so there are no packed blocks to write; add one with `trainer packed` \
         and build this program with that model, or write codes"
    )]
    NoPackedCode {
        /// Model with which this program was built.
        model: ModelId,
    },
    /// Codes are wanted, and the model has no network.
    #[error(
        "model {model} has no network, so there are no codes to write; write packed blocks, with --stream packed"
    )]
    NoNetwork {
        /// Model with which this program was built.
        model: ModelId,
    },
    /// The model cannot decode codes.
    #[error("the model in {} cannot decode codes", folder.display())]
    Model {
        /// Folder of the model.
        folder: PathBuf,
        /// What is wrong with it.
        source: ArtifactError,
    },
    /// The program cannot filter the original recording for this model.
    #[error(
        "{} cannot be compared with codes of model {model}, because this program was built with another \
         one; build it with CORTICODE_ARTIFACT, the absolute path of the model's folder, or leave out \
         --original",
        path.display()
    )]
    OtherOriginal {
        /// Name of the recording.
        path: PathBuf,
        /// Model of the codes.
        model: ModelId,
    },
    /// The name of an output cannot be used.
    #[error(transparent)]
    NewFile(#[from] NewFileError),
    /// An output cannot be written.
    #[error("{} cannot be written; is the disk full?", path.display())]
    Write {
        /// Name of the output.
        path: PathBuf,
        /// Error of the operating system, or of the writer that refuses a value.
        source: io::Error,
    },
    /// The format or the kind of the output cannot hold the signal.
    #[error("{} cannot hold the signal in this format; choose another one with --to, or a regular file", path.display())]
    Format {
        /// Name of the output.
        path: PathBuf,
        /// What does not fit.
        source: io::Error,
    },
    /// A picture cannot be written.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The user ended the program.
    #[error("interrupted; unfinished files were deleted")]
    Interrupted,
}

impl OfflineError {
    /// Returns a closure that makes the error of an output from that of the operating system.
    pub(crate) fn write(path: &std::path::Path) -> impl Fn(io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |source| {
            let path = path.clone();
            match source.kind() {
                io::ErrorKind::InvalidInput | io::ErrorKind::NotSeekable => {
                    Self::Format { path, source }
                }
                _ => Self::Write { path, source },
            }
        }
    }

    /// Returns the exit status of a program: 1 if the output cannot be written any further, or the
    /// user ended the program; 2 if an input or the name of an output cannot be used.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Write { .. }
            | Self::Picture(_)
            | Self::Interrupted
            | Self::NewFile(NewFileError::Finish { .. }) => 1,
            _ => 2,
        }
    }
}
