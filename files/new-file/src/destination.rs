//! Rules for the name under which the user wants a file written.

use std::{
    fs::{self, Metadata},
    io,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
};

use crate::error::NewFileError;

/// Longest chain of symbolic links that is followed; Linux has the same limit.
const MAX_LINKS: usize = 40;

/// What to do if a file with the chosen name exists already.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// Keep the file and return [`NewFileError::Exists`].
    #[default]
    Refuse,
    /// Replace the file by the new one.
    Replace,
}

impl Existing {
    /// Returns [`Self::Replace`] if the user gave the option `--force`, otherwise [`Self::Refuse`].
    pub const fn from_force(force: bool) -> Self {
        if force { Self::Replace } else { Self::Refuse }
    }
}

/// Kind of file that may be written under a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Destination {
    /// A regular file, either new or to be replaced.
    File,
    /// A device or a pipe: bytes are written to it directly, without a temporary file.
    Stream,
}

impl Destination {
    /// Returns the kind of file that `path` names. Fails for a folder, for any of the `inputs`,
    /// which the program reads, and, with [`Existing::Refuse`], for any existing regular file.
    pub(crate) fn check(
        path: &Path,
        existing: Existing,
        inputs: &[PathBuf],
    ) -> Result<Self, NewFileError> {
        let named = || path.to_owned();
        // `metadata` follows links, so an input is recognised under any of its names.
        let Ok(found) = path.metadata() else {
            // A dangling symbolic link also counts as an existing file.
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
            return Err(NewFileError::Input { path: named(), input });
        }
        match existing {
            Existing::Refuse => Err(NewFileError::Exists { path: named() }),
            Existing::Replace => Ok(Self::File),
        }
    }
}

/// Returns the name at the end of a chain of symbolic links, so that the file is replaced, not a
/// link to it. The file need not exist.
pub(crate) fn follow_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..=MAX_LINKS {
        match fs::read_link(&path) {
            Ok(target) => path = folder_of(&path).join(target),
            // `path` is not a symbolic link.
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("its links lead to each other"))
}

/// Returns the folder that holds a file; `.` for a bare file name.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}
