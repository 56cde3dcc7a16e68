//! A recording of the bytes between bridge and device, which the user starts and ends while the
//! bridge runs.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use bridge_core::{HostTime, Settings};
use capture::{FileHeader, Handshake, Recorder};
use jiff::Timestamp;
use link::{Frame, ToHost};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};
use new_file::{Existing, NewFileError};

use crate::app::record::{Offer, RecordingFile};
use crate::error::{BridgeError, causes};
use crate::lock;
use crate::wire::connection::Event;

/// Format of a recording's name: the time in UTC, without characters that a file system rejects or
/// a shell interprets.
const NAME: &str = "corticode-%Y%m%dT%H%M%SZ";
/// Largest number appended to the name when several recordings begin within a second.
const MAX_NUMBER: u32 = 9;
/// Time limit for the disk to store the end of a recording when the bridge exits.
const DISK_TIMEOUT: Duration = Duration::from_secs(10);
/// Largest part of a frame, in bytes, that is stored until the rest arrives.
const MAX_PARTIAL: usize = 4096;

/// The recording in progress, if any, and the handshake and partial frame that begin the next one.
///
/// Only the creation of a file waits for the disk. A thread writes the file, and what does not fit
/// into its queue is lost and counted.
pub(crate) struct LiveRecording {
    folder: PathBuf,
    settings: Settings,
    handshake: Handshake,
    /// Bytes since the end of the newest whole frame.
    partial: Vec<u8>,
    active: Option<Active>,
    ended: Outcome,
    /// Disconnected when the end of the last recording is on the disk or its writing has failed.
    ending: Option<Receiver<()>>,
    room: Arc<Room>,
}

/// How the last recording has ended, for the status.
type Outcome = Arc<Mutex<Option<(DiagnosticLevel, String)>>>;

struct Active {
    recorder: Recorder,
    file: RecordingFile,
    path: PathBuf,
    start: Instant,
    markers: u64,
    lost_bytes: u64,
}

/// Free space on the disk in bytes, measured in another thread because the disk can be slow.
#[derive(Default)]
struct Room {
    bytes: AtomicU64,
    is_measured: AtomicBool,
    is_busy: AtomicBool,
}

/// A recording that was ended, whose last bytes may not be on the disk yet.
pub(crate) struct Ended {
    file: RecordingFile,
    summary: String,
    lost_bytes: u64,
    outcome: Outcome,
    /// Dropped when the file is finished, which disconnects `LiveRecording::ending`.
    _ending: Sender<()>,
}

impl Ended {
    /// Waits for the disk. Returns the summary of the recording, or why its end was not written.
    pub(crate) fn finish(self) -> Result<String, String> {
        let finished = self.file.finish().map_err(|error| {
            let why = causes(&error);
            format!("the end of the recording is not on the disk: {why}; {}", self.summary)
        });
        let level = match &finished {
            Err(_) => DiagnosticLevel::Error,
            Ok(()) if self.lost_bytes > 0 => DiagnosticLevel::Warn,
            Ok(()) => DiagnosticLevel::Ok,
        };
        let result = finished.map(|()| self.summary);
        let (Ok(message) | Err(message)) = &result;
        match &result {
            Ok(summary) => tracing::info!("{summary}"),
            Err(why) => tracing::error!("{why}"),
        }
        *lock(&self.outcome) = Some((level, message.clone()));
        result
    }
}

impl LiveRecording {
    /// Creates the value without a recording in progress. Later recordings become files in
    /// `folder`.
    pub(crate) fn new(folder: PathBuf, settings: Settings) -> LiveRecording {
        LiveRecording {
            folder,
            settings,
            handshake: Handshake::default(),
            partial: Vec::new(),
            active: None,
            ended: Outcome::default(),
            ending: None,
            room: Arc::default(),
        }
    }

    /// Handles an event of the port: records it, and updates the handshake and the partial frame
    /// with which the next recording begins.
    pub(crate) fn note(&mut self, event: Event, bytes: &[u8], at: HostTime) {
        match event {
            Event::Opened => {
                self.handshake.opened();
                self.partial.clear();
            }
            Event::Closed => self.handshake.closed(),
            Event::Bytes(_) => match bytes.iter().rposition(|byte| *byte == 0) {
                Some(end) => bytes[end + 1..].clone_into(&mut self.partial),
                None if self.partial.len() + bytes.len() <= MAX_PARTIAL => {
                    self.partial.extend(bytes);
                }
                None => self.partial.clear(),
            },
        }
        let Some(active) = &mut self.active else {
            return;
        };
        match event {
            Event::Opened => active.recorder.opened(at),
            Event::Bytes(_) => active.recorder.received(bytes, at),
            Event::Closed => active.recorder.closed(at),
        }
    }

    /// Adds a command for the device to the recording in progress, and updates the handshake with
    /// which the next recording begins.
    pub(crate) fn sent(&mut self, frame: &[u8]) {
        self.handshake.sent(frame);
        if let Some(active) = &mut self.active {
            active.recorder.sent(frame, HostTime::now());
        }
    }

    /// Passes a frame from the device to the handshake with which the next recording begins.
    pub(crate) fn received(&mut self, frame: &Frame<ToHost>) {
        self.handshake.received(frame);
    }

    /// Begins a recording. Returns the path of its file.
    pub(crate) fn start(&mut self, now: HostTime) -> Result<PathBuf, String> {
        if let Some(active) = &self.active {
            return Err(format!("{} is being recorded already", name(&active.path)));
        }
        let created = self.create(now);
        let (path, file) = created
            .map_err(|error| format!("{}; --record-dir names another folder", causes(&error)))?;
        let mut recorder = Recorder::new(FileHeader {
            created_ns: now.wall_ns,
            streams: self.settings.streams,
            mains_hz: self.settings.mains_hz,
        });
        self.handshake.begin(&mut recorder, now);
        recorder.received(&self.partial, now);
        tracing::info!("recording to {}", path.display());
        // A new value, because an earlier recording may still write its outcome to the old one.
        self.ended = Outcome::default();
        self.active = Some(Active {
            recorder,
            file,
            path: path.clone(),
            start: Instant::now(),
            markers: 0,
            lost_bytes: 0,
        });
        self.write();
        Ok(path)
    }

    /// Creates a file that is named after the time.
    fn create(&self, now: HostTime) -> Result<(PathBuf, RecordingFile), BridgeError> {
        let time = Timestamp::from_nanosecond(now.wall_ns.into()).unwrap_or_default();
        let stem = time.strftime(NAME).to_string();
        let mut number = 1;
        loop {
            let end = match number {
                1 => String::new(),
                number => format!("-{number}"),
            };
            let path = self.folder.join(format!("{stem}{end}.wire"));
            match RecordingFile::create(&path, Existing::Refuse) {
                Err(BridgeError::NewFile(NewFileError::Exists { .. })) if number < MAX_NUMBER => {
                    number += 1;
                }
                created => return Ok((path, created?)),
            }
        }
    }

    /// Ends the recording.
    pub(crate) fn stop(&mut self, now: HostTime) -> Result<Ended, &'static str> {
        let mut active = self.active.take().ok_or("nothing is being recorded")?;
        active.recorder.finish_piece(now);
        active.write();
        let (done, ending) = channel();
        self.ending = Some(ending);
        Ok(Ended {
            summary: active.summary(),
            lost_bytes: active.lost_bytes,
            file: active.file,
            outcome: Arc::clone(&self.ended),
            _ending: done,
        })
    }

    /// Ends the recording before the program ends. Waits for the disk, at most for
    /// [`DISK_TIMEOUT`].
    pub(crate) fn finish(mut self, now: HostTime) {
        if let Ok(ended) = self.stop(now) {
            thread::spawn(move || ended.finish());
        }
        let ending = self.ending.map(|ending| ending.recv_timeout(DISK_TIMEOUT));
        if ending == Some(Err(RecvTimeoutError::Timeout)) {
            tracing::error!(
                "the disk does not take the end of the recording, which is not complete"
            );
        }
    }

    /// Records a marker. Returns whether the file accepts it; `None` without a recording.
    pub(crate) fn marker(&mut self, text: &str, at: HostTime) -> Option<bool> {
        let active = self.active.as_mut()?;
        let lost_bytes = active.lost_bytes;
        active.recorder.marker(text, at);
        self.write();
        let active = self.active.as_mut();
        let Some(active) = active.filter(|active| active.lost_bytes == lost_bytes) else {
            return Some(false);
        };
        active.markers += 1;
        Some(true)
    }

    /// Passes the recorded bytes to the thread that writes the file. If the file cannot be written
    /// any further, ends the recording and logs why.
    pub(crate) fn write(&mut self) {
        let Some(active) = &mut self.active else {
            return;
        };
        if active.write() {
            return;
        }
        let Some(active) = self.active.take() else {
            return;
        };
        let summary = active.summary();
        let why = match active.file.finish() {
            Ok(()) => "the file takes no more".to_owned(),
            Err(error) => causes(&error),
        };
        let ended = format!("the recording has ended: {why}; what was written stays: {summary}");
        tracing::error!("{ended}");
        *lock(&self.ended) = Some((DiagnosticLevel::Error, ended));
    }

    /// Returns the status `recording` for `/diagnostics`.
    pub(crate) fn status(&self) -> DiagnosticStatus {
        self.room.measure(&self.folder);
        let mut values = Vec::new();
        let (level, message) = match (&self.active, &*lock(&self.ended)) {
            (Some(active), _) => {
                values = vec![
                    KeyValue::new("file", &name(&active.path)),
                    KeyValue::new("bytes", &active.bytes()),
                    KeyValue::new("seconds", &active.start.elapsed().as_secs()),
                    KeyValue::new("markers", &active.markers),
                    KeyValue::new("bytes lost", &active.lost_bytes),
                ];
                if active.lost_bytes > 0 {
                    let message = "the disk is too slow: a part of the recording is lost";
                    (DiagnosticLevel::Warn, message.to_owned())
                } else {
                    (DiagnosticLevel::Ok, format!("recording {}", name(&active.path)))
                }
            }
            (None, Some((level, message))) => (*level, message.clone()),
            (None, None) => (DiagnosticLevel::Ok, "not recording".to_owned()),
        };
        values.push(KeyValue::new("folder", &self.folder.display()));
        if self.room.is_measured.load(Ordering::Relaxed) {
            let room = self.room.bytes.load(Ordering::Relaxed);
            values.push(KeyValue::new("disk left bytes", &room));
        }
        DiagnosticStatus::new("recording", (level, message), values)
    }
}

impl Active {
    /// Queues the recorded bytes for the file. Returns whether the file still accepts bytes.
    fn write(&mut self) -> bool {
        let bytes = self.recorder.take();
        let count = bytes.len() as u64;
        match self.file.offer(bytes) {
            Offer::Taken => true,
            Offer::Lost => {
                self.lost_bytes += count;
                true
            }
            Offer::Closed => false,
        }
    }

    fn bytes(&self) -> u64 {
        self.recorder.bytes() - self.lost_bytes
    }

    fn summary(&self) -> String {
        let (path, seconds) = (self.path.display(), self.start.elapsed().as_secs());
        let (bytes, markers, lost) = (self.bytes(), self.markers, self.lost_bytes);
        format!("{path}: {seconds} s, {bytes} bytes, {markers} markers, {lost} bytes lost")
    }
}

impl Room {
    /// Measures the free space of the disk in another thread, unless the previous measurement has
    /// not ended.
    fn measure(self: &Arc<Room>, folder: &Path) {
        if self.is_busy.swap(true, Ordering::Relaxed) {
            return;
        }
        let (room, folder) = (Arc::clone(self), folder.to_owned());
        tokio::task::spawn_blocking(move || {
            let found = rustix::fs::statvfs(&folder);
            if let Ok(found) = &found {
                let bytes = found.f_bavail.saturating_mul(found.f_frsize);
                room.bytes.store(bytes, Ordering::Relaxed);
            }
            room.is_measured.store(found.is_ok(), Ordering::Relaxed);
            room.is_busy.store(false, Ordering::Relaxed);
        });
    }
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}
