//! Named pipes between a test and the emulator: the UART in both directions, and files that the image reads.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use rustix::fs::{CWD, FileType, Mode, OFlags, mknodat};
use rustix::pipe::fcntl_setpipe_size;

use crate::error::EmulatorError;
use crate::qemu::{Qemu, Uart};

/// Polling interval of a pipe that is empty, or that must not be read yet.
const POLL: Duration = Duration::from_millis(5);

/// Capacity of a UART's pipe in bytes: one second of codes. The queue on the board holds two more
/// seconds.
const CAPACITY: usize = 4096;

/// Runs an image whose UART receives `input`, and returns the bytes that the UART has sent. Nothing is read from
/// the UART before `may_read` returns true.
///
/// # Errors
/// The pipes cannot be created or read, or QEMU fails.
pub fn run(
    mut qemu: Qemu,
    folder: &Path,
    input: &[u8],
    silence: Duration,
    may_read: impl Fn() -> bool + Sync,
) -> Result<Vec<u8>, EmulatorError> {
    let failed = |error| EmulatorError::file(&folder.join("uart"))(error);
    let mut received = open(&folder.join("uart.in")).map_err(failed)?;
    let mut sent = open(&folder.join("uart.out")).map_err(failed)?;
    received.write_all(input).map_err(failed)?;
    qemu.uart(Uart::Pipes("uart"));
    let ended = AtomicBool::new(false);
    let (lines, sent) = thread::scope(|scope| {
        let reader = scope.spawn(|| {
            while !may_read() && !ended.load(Relaxed) {
                thread::sleep(POLL);
            }
            read_until(&mut sent, &ended)
        });
        let lines = qemu.run(silence, |_| ());
        ended.store(true, Relaxed);
        (lines, reader.join())
    });
    let sent = sent.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    lines.and_then(|_| sent.map_err(failed))
}

/// Creates a named pipe, in place of any file of that name. A separate thread writes the chunks into it, as fast as
/// the reader and the iterator permit.
///
/// # Errors
/// The pipe cannot be created.
pub fn feed<T: AsRef<[u8]>>(
    path: &Path,
    mut chunks: impl Iterator<Item = T> + Send + 'static,
) -> Result<(), EmulatorError> {
    create(path).map_err(EmulatorError::file(path))?;
    let path = path.to_owned();
    // The thread ends when QEMU, the reader, closes the pipe.
    thread::spawn(move || -> io::Result<()> {
        let mut pipe = OpenOptions::new().write(true).open(path)?;
        chunks.try_for_each(|chunk| pipe.write_all(chunk.as_ref()))
    });
    Ok(())
}

fn create(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0)?,
    }
    Ok(())
}

/// Creates a named pipe and opens it for both directions; it then stays open when QEMU closes its
/// end.
fn open(path: &Path) -> io::Result<File> {
    create(path)?;
    let mut options = OpenOptions::new();
    let options = options.read(true).write(true);
    let pipe = options
        .custom_flags(OFlags::NONBLOCK.bits().cast_signed())
        .open(path)?;
    fcntl_setpipe_size(&pipe, CAPACITY)?;
    Ok(pipe)
}

/// Reads until the writer has ended and the pipe is empty.
fn read_until(pipe: &mut File, ended: &AtomicBool) -> io::Result<Vec<u8>> {
    let mut sent = Vec::new();
    let mut buffer = [0; CAPACITY];
    loop {
        // Read the flag before the pipe, so that bytes which arrive in between are not missed.
        let last = ended.load(Relaxed);
        match pipe.read(&mut buffer) {
            Ok(count) => sent.extend(&buffer[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock && last => return Ok(sent),
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(POLL),
            Err(error) => return Err(error),
        }
    }
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
        assert_eq!(
            fs::read(&path).expect("the reader's end"),
            [0, 0, 1, 1, 2, 2]
        );
    }

    #[test]
    fn bytes_written_before_the_end_are_read_after_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut pipe = open(&folder.path().join("uart.out")).expect("a pipe");
        pipe.write_all(b"last words").expect("there is room");
        let read = read_until(&mut pipe, &AtomicBool::new(true));
        assert_eq!(read.expect("no error"), b"last words");
    }
}
