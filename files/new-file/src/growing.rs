//! A file that has its final name from the start.

use std::{
    fs::{File, OpenOptions},
    io::{self, ErrorKind, Write},
    path::Path,
};

use crate::{
    destination::{Destination, Existing},
    error::NewFileError,
};

/// A file that has its final name while it grows, such as a recording that must stay readable if
/// the program is killed.
#[derive(Debug)]
pub struct GrowingFile {
    file: File,
    destination: Destination,
}

impl GrowingFile {
    /// Creates a file, or opens a device or a pipe.
    ///
    /// # Errors
    /// [`NewFileError`] if `path` names a folder or, with [`Existing::Refuse`], an existing regular
    /// file, or if the file cannot be created.
    pub fn create(path: &Path, existing: Existing) -> Result<Self, NewFileError> {
        let destination = Destination::check(path, existing, &[])?;
        let mut options = OpenOptions::new();
        options.write(true);
        match (destination, existing) {
            (Destination::Stream, _) => {}
            (Destination::File, Existing::Refuse) => drop(options.create_new(true)),
            (Destination::File, Existing::Replace) => drop(options.create(true).truncate(true)),
        }
        let file = options.open(path).map_err(|source| {
            let path = path.to_owned();
            match source.kind() {
                ErrorKind::AlreadyExists => NewFileError::Exists { path },
                _ => NewFileError::Create { path, source },
            }
        })?;
        Ok(Self { file, destination })
    }

    /// Waits until the disk has all bytes written so far; does nothing for devices and pipes.
    ///
    /// # Errors
    /// The error of the operating system if a byte did not reach the disk.
    pub fn sync(&self) -> io::Result<()> {
        match self.destination {
            Destination::File => self.file.sync_all(),
            Destination::Stream => Ok(()),
        }
    }
}

impl Write for GrowingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_device_takes_bytes_and_is_not_synced() {
        let mut null = GrowingFile::create(Path::new("/dev/null"), Existing::Refuse)
            .expect("every system has it");
        null.write_all(b"bytes").expect("it takes all bytes");
        null.sync().expect("there is no disk to wait for");
    }

    #[test]
    fn bytes_are_under_the_name_at_once_and_an_existing_file_is_replaced_only_on_request() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("wire.cap");
        let mut file = GrowingFile::create(&path, Existing::Refuse).expect("writable");
        file.write_all(b"frame").expect("the disk has room");
        assert_eq!(fs::read(&path).expect("readable"), b"frame");
        file.sync().expect("a disk");
        let refused = GrowingFile::create(&path, Existing::Refuse).expect_err("it exists");
        assert!(matches!(refused, NewFileError::Exists { .. }), "{refused}");
        GrowingFile::create(&path, Existing::Replace).expect("to be replaced");
        assert_eq!(fs::read(&path).expect("readable"), b"");
    }
}
