//! Rules for the name of a file to write.

use std::{
    fs::{self, Metadata},
    io,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
};

use crate::error::NewFileError;

/// Number of symbolic links in a row after which a name is refused, as Linux refuses it.
const MAX_LINKS: usize = 40;

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
    /// Checks a name against the files that the program reads, and against what has the name
    /// already.
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

/// Follows the symbolic links of a name, so that a file is replaced and not a link to it. The last
/// link can lead to a file that does not exist.
pub(crate) fn follow_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..=MAX_LINKS {
        match fs::read_link(&path) {
            Ok(target) => path = folder_of(&path).join(target),
            // Not a link.
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("its links lead to each other"))
}

/// Returns the folder of a file.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}
