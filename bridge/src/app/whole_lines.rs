//! An output that ends with a whole line, even if its disk is full.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::fd::AsFd;

/// Writes lines, each with one call of [`Write::write_all`]. If a line does not fit, its beginning
/// is removed again, where the output is a file.
#[derive(Debug)]
pub(crate) struct WholeLines<O> {
    output: O,
}

/// An output whose last bytes can be removed.
pub(crate) trait RemoveEnd {
    /// Removes the last `bytes` bytes, unless the output is a pipe or a device.
    fn remove_end(&mut self, bytes: u64) -> io::Result<()>;
}

impl RemoveEnd for File {
    fn remove_end(&mut self, bytes: u64) -> io::Result<()> {
        let metadata = self.metadata()?;
        if metadata.is_file() {
            let length = metadata.len().saturating_sub(bytes);
            self.set_len(length)?;
            self.seek(SeekFrom::Start(length))?;
        }
        Ok(())
    }
}

impl WholeLines<File> {
    /// Returns the standard output of this process, without the buffer of [`std::io::stdout`].
    ///
    /// # Errors
    ///
    /// The operating system's error, for example when no file descriptor is left.
    pub(crate) fn stdout() -> io::Result<WholeLines<File>> {
        let output = io::stdout().as_fd().try_clone_to_owned()?;
        Ok(WholeLines {
            output: File::from(output),
        })
    }
}

impl<O: Write + RemoveEnd> Write for WholeLines<O> {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let mut written = 0;
        while written < line.len() {
            match self.output.write(&line[written..]) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => written += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    if written > 0 {
                        self.output.remove_end(written as u64)?;
                    }
                    return Err(error);
                }
            }
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::{self, ErrorKind, Write};

    use super::{RemoveEnd, WholeLines};

    /// A file on a disk with room for a few bytes.
    struct SmallDisk {
        file: File,
        room: usize,
    }

    impl Write for SmallDisk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.room == 0 {
                return Err(ErrorKind::StorageFull.into());
            }
            let count = self.file.write(&bytes[..bytes.len().min(self.room)])?;
            self.room -= count;
            Ok(count)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    impl RemoveEnd for SmallDisk {
        fn remove_end(&mut self, bytes: u64) -> io::Result<()> {
            self.file.remove_end(bytes)
        }
    }

    #[test]
    fn a_line_that_does_not_fit_leaves_no_part_in_the_file() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let file = path.reopen().unwrap();
        let output = SmallDisk { file, room: 10 };
        let mut lines = WholeLines { output };
        lines.write_all(b"{\"a\":1}\n").unwrap();
        let error = lines.write_all(b"{\"a\":2}\n").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::StorageFull);
        let text = std::fs::read_to_string(path.path()).unwrap();
        assert_eq!(text, "{\"a\":1}\n");
    }
}
