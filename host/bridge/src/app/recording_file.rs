//! The file of a recording, written by a thread of its own.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use new_file::{Existing, GrowingFile};

use crate::error::BridgeError;

/// Longest time from a byte's arrival until it is on the disk, unless the disk is slower.
const SYNC_INTERVAL: Duration = Duration::from_secs(1);
/// Number of chunks that wait for the disk: about a minute of all streams. When more wait, reading
/// from the port waits too, and the device counts what it cannot send.
const QUEUE_CHUNKS: usize = 8192;

/// A new file that a thread appends to, so that a slow disk does not delay the reading of the port.
#[derive(Debug)]
pub(crate) struct RecordingFile {
    path: PathBuf,
    chunks: SyncSender<Vec<u8>>,
    thread: JoinHandle<io::Result<()>>,
}

impl RecordingFile {
    /// Creates the file, or replaces it with [`Existing::Replace`].
    ///
    /// # Errors
    ///
    /// [`BridgeError::NewFile`]; [`BridgeError::System`] if no thread can be started.
    pub(crate) fn create(path: &Path, existing: Existing) -> Result<RecordingFile, BridgeError> {
        let file = GrowingFile::create(path, existing)?;
        let (chunks, receiver) = sync_channel(QUEUE_CHUNKS);
        let thread = std::thread::Builder::new()
            .name("recording".to_owned())
            .spawn(move || append_all(file, &receiver))?;
        Ok(RecordingFile {
            path: path.to_owned(),
            chunks,
            thread,
        })
    }

    /// Queues bytes for the file and returns whether it still accepts any. If it does not,
    /// [`RecordingFile::finish`] returns the reason.
    pub(crate) fn append(&self, bytes: Vec<u8>) -> bool {
        bytes.is_empty() || self.chunks.send(bytes).is_ok()
    }

    /// Waits until all bytes are on the disk.
    ///
    /// # Errors
    ///
    /// [`BridgeError::FileWrite`] if a byte could not be written.
    pub(crate) fn finish(self) -> Result<(), BridgeError> {
        drop(self.chunks);
        let ended = self.thread.join();
        let ended = ended.unwrap_or_else(|_| Err(io::Error::other("the writing thread failed")));
        ended.map_err(|source| BridgeError::FileWrite {
            path: self.path,
            source,
        })
    }
}

/// Appends each chunk as it comes, so that it survives the end of this process, and once a second
/// waits until the disk has everything, so that it survives a loss of power.
fn append_all(mut file: GrowingFile, chunks: &Receiver<Vec<u8>>) -> io::Result<()> {
    let mut synced = Instant::now();
    let mut unsynced = false;
    loop {
        match chunks.recv_timeout(SYNC_INTERVAL) {
            Ok(chunk) => {
                file.write_all(&chunk)?;
                unsynced = true;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return file.sync(),
        }
        if unsynced && synced.elapsed() >= SYNC_INTERVAL {
            file.sync()?;
            synced = Instant::now();
            unsynced = false;
        }
    }
}
