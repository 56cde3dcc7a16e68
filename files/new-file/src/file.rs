//! A file that gets its name only when it is complete.

use std::{
    ffi::OsStr,
    fs::{File, OpenOptions, Permissions},
    io::{self, Write},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};

use tempfile::{Builder, NamedTempFile};

use crate::{
    destination::{Destination, Existing, folder_of, follow_links},
    error::NewFileError,
};

/// Permissions of a new file before the umask applies. `tempfile` alone would set 0o600.
const MODE: u32 = 0o666;

/// A file that is written under a temporary name. [`NewFile::finish`] renames it to its final name;
/// dropping it before that deletes it.
#[derive(Debug)]
pub struct NewFile {
    /// Name that the user chose.
    path: PathBuf,
    /// Name of the file that is really written: `path`, or the target if `path` is a symbolic link.
    target: PathBuf,
    existing: Existing,
    bytes: Bytes,
}

#[derive(Debug)]
enum Bytes {
    Temporary(NamedTempFile),
    /// A device or a pipe, which is written directly.
    Stream(File),
}

impl NewFile {
    /// Creates a temporary file, which [`Self::finish`] renames to `path`; opens a device or a pipe
    /// directly. `inputs` are the files that the program reads; they are never overwritten.
    ///
    /// # Errors
    /// [`NewFileError`] if `path` names an input, a folder or, with [`Existing::Refuse`], any
    /// existing regular file; or if the file cannot be created.
    pub fn create(
        path: &Path,
        existing: Existing,
        inputs: &[PathBuf],
    ) -> Result<Self, NewFileError> {
        let destination = Destination::check(path, existing, inputs)?;
        let create = || {
            let target = follow_links(path)?;
            let bytes = match destination {
                Destination::Stream => Bytes::Stream(OpenOptions::new().write(true).open(&target)?),
                Destination::File => Bytes::Temporary(temporary(&target)?),
            };
            Ok((target, bytes))
        };
        let (target, bytes) =
            create().map_err(|source| NewFileError::Create { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), target, existing, bytes })
    }

    /// Returns a second handle to the file, for a writer that takes a [`File`].
    ///
    /// # Errors
    /// The error of the operating system if it cannot create another handle.
    pub fn handle(&self) -> io::Result<File> {
        self.file().try_clone()
    }

    /// Gives the complete file its name. For a device or a pipe there is nothing left to do.
    ///
    /// # Errors
    /// [`NewFileError::Finish`] if the bytes did not reach the disk, if the file cannot be renamed,
    /// or, with [`Existing::Refuse`], if another program has meanwhile created a file with this
    /// name. The temporary file is then kept, and the error states its name.
    pub fn finish(self) -> Result<(), NewFileError> {
        let Bytes::Temporary(mut file) = self.bytes else {
            return Ok(());
        };
        file.disable_cleanup(true);
        let kept = file.path().to_owned();
        // Without `sync_all`, a power failure after the rename could leave an empty file.
        let finished = file.as_file().sync_all().and_then(|()| {
            match self.existing {
                Existing::Refuse => file.persist_noclobber(&self.target),
                Existing::Replace => file.persist(&self.target),
            }
            .map_err(|error| error.error)
        });
        match finished {
            Ok(_) => Ok(()),
            Err(source) => Err(NewFileError::Finish { path: self.path, kept, source }),
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
    let name = path.file_name().unwrap_or(OsStr::new("file"));
    let mut prefix = OsStr::new(".").to_owned();
    prefix.push(name);
    prefix.push(".");
    Builder::new()
        .prefix(&prefix)
        .suffix(".part")
        .permissions(Permissions::from_mode(MODE))
        .tempfile_in(folder_of(path))
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
                assert!(matches!(refused, NewFileError::Input { .. }), "{name}: {refused}");
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
    fn a_file_that_cannot_be_renamed_stays_under_the_name_in_the_error() {
        let folder = folder();
        let path = folder.path().join("codes.bin");
        for existing in [Existing::Refuse, Existing::Replace] {
            let mut file = NewFile::create(&path, existing, &[]).expect("writable");
            file.write_all(b"new").expect("the disk has room");
            // `Refuse` must not replace another program's file; `Replace` cannot replace a folder.
            match existing {
                Existing::Refuse => fs::write(&path, b"other").expect("writable"),
                Existing::Replace => fs::create_dir(&path).expect("writable"),
            }
            let failed = file.finish().expect_err("the name is taken");
            let text = failed.to_string();
            let NewFileError::Finish { kept, .. } = failed else {
                panic!("{failed}");
            };
            assert!(text.contains(&kept.display().to_string()), "{text}");
            assert_eq!(fs::read(&kept).expect("kept"), b"new");
            if existing == Existing::Refuse {
                assert_eq!(fs::read(&path).expect("still there"), b"other");
                fs::remove_file(&path).expect("a file");
            }
        }
    }

    #[test]
    fn the_target_of_a_link_is_replaced_and_the_link_stays() {
        use std::os::unix::fs::symlink;
        let folder = folder();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("disk")).expect("a folder");
        fs::write(at("disk/old"), b"old").expect("writable");
        symlink("disk/old", at("link")).expect("a link");
        symlink("link", at("link-to-link")).expect("a link");
        symlink("disk/absent", at("dangling")).expect("a link");
        for (link, target) in [("link-to-link", "disk/old"), ("dangling", "disk/absent")] {
            create(&at(link), Existing::Replace, &[]).expect("to be replaced");
            assert!(at(link).is_symlink(), "{link} is no link any more");
            assert_eq!(fs::read(at(target)).expect("the target"), b"new");
        }
        symlink("ring", at("ring")).expect("a link");
        let refused = create(&at("ring"), Existing::Replace, &[]).expect_err("it leads nowhere");
        assert!(matches!(refused, NewFileError::Create { .. }), "{refused}");
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
