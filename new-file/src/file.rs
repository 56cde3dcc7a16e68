//! A file that appears under its name when it is complete.

use std::{
    ffi::OsStr,
    fs::{File, OpenOptions, Permissions},
    io::{self, ErrorKind, Write},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};

use tempfile::{Builder, NamedTempFile};

use crate::{
    destination::{Destination, Existing},
    error::NewFileError,
};

/// Permissions of a new file before the user's mask applies. Temporary files have fewer by default.
const MODE: u32 = 0o666;

/// A file to write, which [`NewFile::finish`] moves to its name. Dropping it deletes what was written.
#[derive(Debug)]
pub struct NewFile {
    path: PathBuf,
    existing: Existing,
    bytes: Bytes,
}

#[derive(Debug)]
enum Bytes {
    Temporary(NamedTempFile),
    /// A device or a pipe.
    Stream(File),
}

impl NewFile {
    /// Creates a file for the name `path`, in the same folder. `inputs` are the files that the program
    /// reads.
    ///
    /// # Errors
    /// [`NewFileError`] if the name is that of an input, of a folder, or, with [`Existing::Refuse`], of
    /// any file; or if the file cannot be created.
    pub fn create(
        path: &Path,
        existing: Existing,
        inputs: &[PathBuf],
    ) -> Result<Self, NewFileError> {
        let create = || {
            match Destination::check(path, existing, inputs)? {
                Destination::Stream => OpenOptions::new().write(true).open(path).map(Bytes::Stream),
                Destination::File => temporary(path).map(Bytes::Temporary),
            }
            .map_err(|source| NewFileError::Create {
                path: path.to_owned(),
                source,
            })
        };
        Ok(Self {
            path: path.to_owned(),
            existing,
            bytes: create()?,
        })
    }

    /// Returns a second handle of the file, for a writer that takes a [`File`].
    ///
    /// # Errors
    /// The error of the operating system if it has no handle left.
    pub fn handle(&self) -> io::Result<File> {
        self.file().try_clone()
    }

    /// Moves the complete file to its name.
    ///
    /// # Errors
    /// [`NewFileError::Exists`] if another program has made a file with this name meanwhile,
    /// [`NewFileError::Finish`] if the bytes did not reach the disk or the file cannot be renamed.
    pub fn finish(self) -> Result<(), NewFileError> {
        let Self {
            path,
            existing,
            bytes: Bytes::Temporary(file),
        } = self
        else {
            return Ok(());
        };
        // After the rename a loss of power must not leave an empty file under the name.
        let finished = file.as_file().sync_all().and_then(|()| {
            match existing {
                Existing::Refuse => file.persist_noclobber(&path),
                Existing::Replace => file.persist(&path),
            }
            .map_err(|error| error.error)
        });
        match finished {
            Ok(_) => Ok(()),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                Err(NewFileError::Exists { path })
            }
            Err(source) => Err(NewFileError::Finish { path, source }),
        }
    }

    fn file(&self) -> &File {
        match &self.bytes {
            Bytes::Temporary(file) => file.as_file(),
            Bytes::Stream(file) => file,
        }
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file().flush()
    }
}

fn temporary(path: &Path) -> io::Result<NamedTempFile> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let name = path.file_name().unwrap_or(OsStr::new("file"));
    let mut prefix = OsStr::new(".").to_owned();
    prefix.push(name);
    prefix.push(".");
    Builder::new()
        .prefix(&prefix)
        .suffix(".part")
        .permissions(Permissions::from_mode(MODE))
        .tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn folder() -> tempfile::TempDir {
        tempfile::tempdir().expect("a temporary folder")
    }

    fn create(path: &Path, existing: Existing, inputs: &[PathBuf]) -> Result<(), NewFileError> {
        let mut file = NewFile::create(path, existing, inputs)?;
        file.write_all(b"new").expect("the disk has room");
        file.finish()
    }

    #[test]
    fn an_existing_file_is_replaced_only_on_request() {
        let folder = folder();
        let path = folder.path().join("codes.bin");
        fs::write(&path, b"old").expect("writable");
        let refused = create(&path, Existing::Refuse, &[]).expect_err("it exists");
        assert!(refused.to_string().contains("--force"), "{refused}");
        assert_eq!(fs::read(&path).expect("still there"), b"old");
        create(&path, Existing::Replace, &[]).expect("to be replaced");
        assert_eq!(fs::read(&path).expect("replaced"), b"new");
    }

    #[test]
    fn an_input_is_refused_under_each_of_its_names() {
        let folder = folder();
        let at = |name: &str| folder.path().join(name);
        let input = at("session.edf");
        fs::write(&input, b"EEG").expect("writable");
        std::os::unix::fs::symlink(&input, at("symbolic")).expect("a link");
        fs::hard_link(&input, at("hard")).expect("a link");
        let inputs = [input.clone()];
        for name in ["session.edf", "symbolic", "hard", "./session.edf"] {
            for existing in [Existing::Refuse, Existing::Replace] {
                let refused = create(&at(name), existing, &inputs).expect_err("it is the input");
                assert!(
                    matches!(refused, NewFileError::Input { .. }),
                    "{name}: {refused}"
                );
            }
        }
        assert_eq!(fs::read(&input).expect("untouched"), b"EEG");
    }

    #[test]
    fn an_unfinished_file_leaves_nothing() {
        let folder = folder();
        let path = folder.path().join("codes.bin");
        let mut file = NewFile::create(&path, Existing::Refuse, &[]).expect("writable");
        file.write_all(b"half").expect("the disk has room");
        drop(file);
        let left = fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(left, 0);
    }

    #[test]
    fn a_file_that_appears_meanwhile_is_not_replaced() {
        let folder = folder();
        let path = folder.path().join("codes.bin");
        let file = NewFile::create(&path, Existing::Refuse, &[]).expect("writable");
        fs::write(&path, b"other").expect("writable");
        let refused = file.finish().expect_err("it exists now");
        assert!(matches!(refused, NewFileError::Exists { .. }), "{refused}");
        assert_eq!(fs::read(&path).expect("still there"), b"other");
    }

    #[test]
    fn a_device_is_written_and_a_folder_refused() {
        create(Path::new("/dev/null"), Existing::Refuse, &[]).expect("it takes bytes");
        let refused = create(Path::new("/tmp"), Existing::Replace, &[]).expect_err("a folder");
        assert!(matches!(refused, NewFileError::Folder { .. }), "{refused}");
    }

    #[test]
    fn a_new_file_has_the_usual_permissions() {
        let folder = folder();
        let [ours, usual] = ["ours", "usual"].map(|name| folder.path().join(name));
        create(&ours, Existing::Refuse, &[]).expect("writable");
        fs::write(&usual, b"").expect("writable");
        let mode = |path: &Path| path.metadata().expect("a file").permissions().mode();
        assert_eq!(mode(&ours), mode(&usual));
    }
}
