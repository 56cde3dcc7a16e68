//! Named pipes between a test and the emulator, for the UART and for files that the image reads.

use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::thread;

use rustix::fs::{CWD, FileType, Mode, mknodat};

use crate::error::EmulatorError;

/// Creates a named pipe in place of any file of that name. A new thread writes the chunks to the
/// pipe, as fast as the reader takes them.
///
/// # Errors
/// The pipe cannot be created.
pub fn feed<T: AsRef<[u8]>>(
    path: &Path,
    mut chunks: impl Iterator<Item = T> + Send + 'static,
) -> Result<(), EmulatorError> {
    create(path)?;
    let path = path.to_owned();
    // The thread ends when all chunks are written, or when QEMU closes the pipe.
    thread::spawn(move || -> io::Result<()> {
        let mut pipe = OpenOptions::new().write(true).open(path)?;
        chunks.try_for_each(|chunk| pipe.write_all(chunk.as_ref()))
    });
    Ok(())
}

/// Creates a named pipe in place of any file of that name.
///
/// # Errors
/// The pipe cannot be created.
pub fn create(path: &Path) -> Result<(), EmulatorError> {
    let created = match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).map_err(Into::into),
    };
    created.map_err(EmulatorError::file(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fed_pipe_replaces_a_file_and_delivers_all_chunks() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("samples");
        fs::write(&path, "old").expect("a file");
        feed(&path, (0..3u8).map(|chunk| [chunk; 2])).expect("a pipe");
        let read = fs::read(&path).expect("the reader's end");
        assert_eq!(read, [0, 0, 1, 1, 2, 2]);
    }
}
