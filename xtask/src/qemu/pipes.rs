//! The UART of an emulated board as two pipes: what a host says, and what it hears in its own time.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use rustix::fs::{CWD, FileType, Mode, OFlags, mknodat};
use rustix::pipe::fcntl_setpipe_size;

use crate::benchmark::cannot_write;
use crate::benchmark::emulator;
use crate::failure::Failure;

/// How often the pipe is looked at.
const POLL: Duration = Duration::from_millis(5);

/// Bytes that the pipe holds: one second of codes. The board holds two more.
const HELD: usize = 4096;

/// Runs an image to its end, and gives what its UART has sent. The board hears the host's `words`. The host
/// reads nothing until the pipe has not grown for `stalled`.
///
/// # Errors
/// The pipes cannot be made, or QEMU fails.
pub(super) fn run_to_end(
    command: &mut Command,
    folder: &Path,
    words: &[u8],
    patience: Duration,
    stalled: Duration,
) -> Result<Vec<u8>, Failure> {
    let failed = |error| cannot_write(folder, &error);
    // The two ends of QEMU's `-serial pipe:`.
    let mut input = pipe(&folder.join("uart.in")).map_err(failed)?;
    let mut output = pipe(&folder.join("uart.out")).map_err(failed)?;
    input.write_all(words).map_err(failed)?;
    command.args(["-serial", "pipe:uart"]);
    let ended = AtomicBool::new(false);
    let (said, sent) = thread::scope(|scope| {
        let reader = scope.spawn(|| read_late(&mut output, &ended, stalled));
        let said = emulator::run_to_end(command, patience, |_| ());
        ended.store(true, Relaxed);
        (said, reader.join())
    });
    let sent = sent.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let sent = sent.map_err(failed)?;
    said.map(|_| sent)
}

/// A fresh pipe with a name. Opened for both directions, so that it outlives QEMU's end of it.
fn pipe(path: &Path) -> std::io::Result<File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0)?,
    }
    let flags = OFlags::NONBLOCK.bits().cast_signed();
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    let pipe = options.custom_flags(flags).open(path)?;
    fcntl_setpipe_size(&pipe, HELD)?;
    Ok(pipe)
}

/// Reads nothing until the pipe has not grown for so long: it is full. Then all, until QEMU has ended.
fn read_late(pipe: &mut File, ended: &AtomicBool, stalled: Duration) -> std::io::Result<Vec<u8>> {
    let mut waiting = 0;
    let mut since = Instant::now();
    while (waiting == 0 || since.elapsed() < stalled) && !ended.load(Relaxed) {
        thread::sleep(POLL);
        let now = rustix::io::ioctl_fionread(&*pipe)?;
        if now != waiting {
            (waiting, since) = (now, Instant::now());
        }
    }
    let mut sent = Vec::new();
    let mut buffer = [0; 4096];
    loop {
        // Looked at before the pipe: what comes between is read.
        let last = ended.load(Relaxed);
        match pipe.read(&mut buffer) {
            Ok(count) => sent.extend(&buffer[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock && last => return Ok(sent),
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(POLL),
            Err(error) => return Err(error),
        }
    }
}
