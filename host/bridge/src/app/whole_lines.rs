//! An output that ends with a whole line, even if its disk is full.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::fd::AsFd;

use rustix::fs::{OFlags, fcntl_getfl};

/// Writes lines, each with one call of [`Write::write_all`]. If a line does not fit, its beginning
/// is removed again, where the output is a file that this program alone writes.
#[derive(Debug)]
pub(crate) struct WholeLines<O> {
    output: O,
}

/// An output whose last bytes can be removed.
pub(crate) trait RemoveEnd {
    /// Removes the last `bytes` bytes that were written, if the output is a file that no other
    /// program appends to.
    fn remove_end(&mut self, bytes: u64) -> io::Result<()>;
}

impl RemoveEnd for File {
    fn remove_end(&mut self, bytes: u64) -> io::Result<()> {
        let end = self.stream_position();
        let metadata = self.metadata()?;
        // In append mode other programs can write to the file at any time, so its end cannot be cut
        // off without a risk. In another mode they have written if the file goes on after this
        // program's last byte.
        let appends = fcntl_getfl(&*self)?.contains(OFlags::APPEND);
        if metadata.is_file() && !appends {
            let end = end?;
            if metadata.len() == end {
                let length = end.saturating_sub(bytes);
                self.set_len(length)?;
                self.seek(SeekFrom::Start(length))?;
            }
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

    /// A file on a disk with room for a few bytes. Another program appends to the file when the
    /// disk becomes full.
    struct SmallDisk {
        file: File,
        room: usize,
        other: Option<File>,
    }

    impl Write for SmallDisk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.room == 0 {
                if let Some(other) = &mut self.other {
                    other.write_all(b"other\n")?;
                }
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
        let output = SmallDisk {
            file,
            room: 10,
            other: None,
        };
        let mut lines = WholeLines { output };
        lines.write_all(b"{\"a\":1}\n").unwrap();
        let error = lines.write_all(b"{\"a\":2}\n").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::StorageFull);
        let text = std::fs::read_to_string(path.path()).unwrap();
        assert_eq!(text, "{\"a\":1}\n");
    }

    #[test]
    fn what_another_program_appends_is_never_removed() {
        for appends in [false, true] {
            let path = tempfile::NamedTempFile::new().unwrap();
            let open = |append: bool| {
                let mut options = File::options();
                options
                    .write(true)
                    .append(append)
                    .open(path.path())
                    .unwrap()
            };
            let output = SmallDisk {
                file: open(appends),
                room: 10,
                other: Some(open(true)),
            };
            let mut lines = WholeLines { output };
            lines.write_all(b"{\"a\":1}\n").unwrap();
            lines.write_all(b"{\"a\":2}\n").unwrap_err();
            let text = std::fs::read_to_string(path.path()).unwrap();
            assert_eq!(text, "{\"a\":1}\n{\"other\n", "append mode: {appends}");
        }
    }

    #[test]
    fn the_end_of_a_file_in_append_mode_is_left_to_whoever_writes_next() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let mut options = File::options();
        let file = options.append(true).open(path.path()).unwrap();
        let output = SmallDisk {
            file,
            room: 10,
            other: None,
        };
        let mut lines = WholeLines { output };
        lines.write_all(b"{\"a\":1}\n").unwrap();
        lines.write_all(b"{\"a\":2}\n").unwrap_err();
        let text = std::fs::read_to_string(path.path()).unwrap();
        assert_eq!(text, "{\"a\":1}\n{\"");
    }
}
