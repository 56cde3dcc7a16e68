//! An output that ends with a whole line, even if its disk is full.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::fd::AsFd;

use rustix::fs::{OFlags, fcntl_getfl};

/// Writes lines, each with one call of [`Write::write_all`]. If a line does not fit on the disk,
/// its beginning is removed again, provided that no other program writes to the same file.
#[derive(Debug)]
pub(crate) struct WholeLines(File);

impl WholeLines {
    /// Returns the standard output of this process, without the buffer of [`std::io::stdout`].
    ///
    /// # Errors
    ///
    /// The operating system's error, for example when no file descriptor is left.
    pub(crate) fn stdout() -> io::Result<WholeLines> {
        let output = io::stdout().as_fd().try_clone_to_owned()?;
        Ok(WholeLines(File::from(output)))
    }
}

impl Write for WholeLines {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let mut written = 0;
        while written < line.len() {
            match self.0.write(&line[written..]) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => written += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    if written > 0 {
                        remove_end(&mut self.0, written as u64)?;
                    }
                    return Err(error);
                }
            }
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Removes the last `bytes` bytes that this program wrote, if the output is a file to which no
/// other program appends.
fn remove_end(file: &mut File, bytes: u64) -> io::Result<()> {
    let metadata = file.metadata()?;
    // In append mode another program may write at any time, so cutting off the end could remove its
    // bytes. In another mode, a file that continues after this program's last byte has bytes of
    // another program at its end.
    let appends = fcntl_getfl(&*file)?.contains(OFlags::APPEND);
    if metadata.is_file() && !appends {
        let end = file.stream_position()?;
        if metadata.len() == end {
            let length = end.saturating_sub(bytes);
            file.set_len(length)?;
            file.seek(SeekFrom::Start(length))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;

    use super::remove_end;

    #[test]
    fn the_end_is_removed_unless_another_program_can_append() {
        // Each case: whether the file is in append mode, whether another program has appended to
        // it, and the content that must be left.
        for (appends, is_shared, expected) in [
            (false, false, "line\n"),
            (false, true, "line\n{\"other\n"),
            (true, false, "line\n{\""),
            (true, true, "line\n{\"other\n"),
        ] {
            let path = tempfile::NamedTempFile::new().unwrap();
            let open = |append: bool| {
                let mut options = File::options();
                let options = options.write(true).append(append);
                options.open(path.path()).unwrap()
            };
            let mut file = open(appends);
            file.write_all(b"line\n{\"").unwrap();
            if is_shared {
                open(true).write_all(b"other\n").unwrap();
            }
            remove_end(&mut file, 2).unwrap();
            let text = std::fs::read_to_string(path.path()).unwrap();
            assert_eq!(text, expected, "append mode: {appends}");
        }
    }
}
