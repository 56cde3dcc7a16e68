//! Rules for the name of a file to write.

use std::{
    fs::{File, Metadata, OpenOptions},
    io::ErrorKind,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
};

use crate::error::NewFileError;

/// Treatment of a file that has the name already.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// Return [`NewFileError::Exists`].
    #[default]
    Refuse,
    /// Replace the file.
    Replace,
}

impl Existing {
    /// Returns the treatment that the option `--force` selects.
    pub const fn from_force(force: bool) -> Self {
        if force { Self::Replace } else { Self::Refuse }
    }
}

/// Kind of file that may be written under a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Destination {
    /// A file, new or to be replaced.
    File,
    /// A device or a pipe, which is written as it is and has no temporary name.
    Stream,
}

impl Destination {
    /// Checks a name against the files that the program reads, and against what has the name already.
    pub(crate) fn check(
        path: &Path,
        existing: Existing,
        inputs: &[PathBuf],
    ) -> Result<Self, NewFileError> {
        let named = || path.to_owned();
        // Follows links, so that an input is found under any of its names.
        let Ok(found) = path.metadata() else {
            // A link to nothing is a file of the user, too.
            return if path.is_symlink() && existing == Existing::Refuse {
                Err(NewFileError::Exists { path: named() })
            } else {
                Ok(Self::File)
            };
        };
        if found.is_dir() {
            return Err(NewFileError::Folder { path: named() });
        }
        if !found.is_file() {
            return Ok(Self::Stream);
        }
        let is_same = |other: &Metadata| (other.dev(), other.ino()) == (found.dev(), found.ino());
        let mut inputs = inputs.iter();
        if let Some(input) =
            inputs.find(|input| input.metadata().is_ok_and(|other| is_same(&other)))
        {
            let input = input.clone();
            return Err(NewFileError::Input {
                path: named(),
                input,
            });
        }
        match existing {
            Existing::Refuse => Err(NewFileError::Exists { path: named() }),
            Existing::Replace => Ok(Self::File),
        }
    }
}

/// Creates a file that grows under its own name, such as a recording that must stay readable after a
/// kill.
///
/// # Errors
/// [`NewFileError`] if the name cannot be used.
pub fn create_growing(path: &Path, existing: Existing) -> Result<File, NewFileError> {
    let destination = Destination::check(path, existing, &[])?;
    let mut options = OpenOptions::new();
    options.write(true);
    match (destination, existing) {
        (Destination::Stream, _) => {}
        (Destination::File, Existing::Refuse) => drop(options.create_new(true)),
        (Destination::File, Existing::Replace) => drop(options.create(true).truncate(true)),
    }
    options.open(path).map_err(|source| {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::AlreadyExists => NewFileError::Exists { path },
            _ => NewFileError::Create { path, source },
        }
    })
}
