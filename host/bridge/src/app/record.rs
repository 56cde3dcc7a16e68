//! The subcommand `record`: connects the state machine [`Core`] to a port and to a recording's
//! file.

use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bridge_core::{Announcement, Core, Effects, FillerPolicy, HostTime, Model, Settings, Summary};
use capture::{FileHeader, Recorder};
use indicatif::{DecimalBytes, FormattedDuration, ProgressBar};
use link::Streams;
use new_file::{Existing, GrowingFile};

use crate::app::command_line::RecordOptions;
use crate::app::driver::{Driver, PortEffects};
use crate::app::shutdown::Shutdown;
use crate::error::BridgeError;
use crate::wire::connection::{Connection, Event, Feed};

/// Summary of a finished recording; prints as one line.
#[derive(Debug)]
pub(crate) struct RecordSummary {
    path: PathBuf,
    duration: Duration,
    bytes: u64,
    core: Summary,
}

impl fmt::Display for RecordSummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{}: {}, {}; {}",
            self.path.display(),
            FormattedDuration(self.duration),
            DecimalBytes(self.bytes),
            self.core
        )
    }
}

/// Records until SIGTERM or Ctrl-C, then stops the device and closes the file.
///
/// # Errors
///
/// [`BridgeError`] if the file or the port cannot be used. An absent device is not an error; the
/// recording waits.
pub(super) async fn record(options: RecordOptions) -> Result<RecordSummary, BridgeError> {
    let mut shutdown = Shutdown::new()?;
    options.asked.warn_about_unused();
    let settings = Settings {
        mains_hz: options.asked.mains.unwrap_or(0),
        filler: FillerPolicy::Off,
        streams: options.asked.streams(),
        packed_rate: options.asked.packed_rate,
        ..Settings::default()
    };
    let header = FileHeader {
        created_ns: HostTime::now().wall_ns,
        streams: settings.streams,
        mains_hz: settings.mains_hz,
    };
    let model_rate = ModelRate::new(settings)?;
    let mut core = Core::new(settings, None);
    core.set_exclusions(options.asked.exclusion.exclusions());
    if let Some(series_ohms) = options.asked.contacts.impedance() {
        core.measure_impedance(series_ohms);
    }
    if let Some(classifier) = options.asked.classifying.read()? {
        core.set_classifier(classifier);
    } else if settings.streams.contains(Streams::FEATURES) {
        return Err(BridgeError::NoClassifier);
    }
    let mut recording = Recording {
        driver: Driver::new(core, Connection::new(options.at.port, options.at.baud)),
        port: RecordedPort {
            recorder: Recorder::new(header),
            outgoing: Vec::new(),
            announced: None,
        },
        model_rate,
        file: RecordingFile::create(&options.file, Existing::from_force(options.force))?,
        start: Instant::now(),
    };
    let ended = recording.run(&mut shutdown).await;
    recording.port.recorder.finish_piece(HostTime::now());
    recording.write();
    let summary = RecordSummary {
        path: options.file,
        duration: recording.start.elapsed(),
        bytes: recording.port.recorder.bytes(),
        core: recording.driver.core.summary(),
    };
    let written = recording.file.finish();
    if written.is_err() {
        new_file::message!("corticode-bridge: {summary}");
    }
    written.and(ended).map(|()| summary)
}

/// Id of the built-in model, and the rate of the packed code that this model specifies.
struct ModelRate {
    model: [u8; 8],
    rate: u8,
}

impl ModelRate {
    /// Returns the model's rate; `None` if the user chose a rate, no packed blocks are recorded, or
    /// the model has no packed code.
    fn new(settings: Settings) -> Result<Option<ModelRate>, BridgeError> {
        if settings.packed_rate.is_some() || !settings.streams.contains(Streams::PACKED) {
            return Ok(None);
        }
        let model = Model::embedded().map_err(BridgeError::Model)?;
        let packed = model.packed();
        Ok(packed.map(|packed| ModelRate { model: model.id(), rate: packed.description.rate }))
    }
}

/// A recording in progress: the core at its port, and the file.
struct Recording {
    driver: Driver<Connection>,
    port: RecordedPort,
    /// Rate to set on devices with the built-in model; `None` to leave their rate as it is.
    model_rate: Option<ModelRate>,
    file: RecordingFile,
    start: Instant,
}

impl Recording {
    async fn run(&mut self, shutdown: &mut Shutdown) -> Result<(), BridgeError> {
        let spinner = ProgressBar::new_spinner();
        spinner.enable_steady_tick(Core::TICK);
        loop {
            tokio::select! {
                event = self.driver.next(&mut self.port, false) => match event? {
                    Some(_) => self.set_model_rate(),
                    None => spinner.set_message(self.progress_text()),
                },
                reason = shutdown.requested(), if !self.driver.is_ending() => {
                    tracing::info!("ending the recording: {reason}");
                    self.port.recorder.ending(HostTime::now());
                    self.driver.end(&mut self.port);
                }
            }
            if !self.write() && !self.driver.is_ending() {
                shutdown.request("the file cannot be written any further");
            }
            if self.driver.has_ended() {
                spinner.finish_and_clear();
                return Ok(());
            }
        }
    }

    /// Sets the rate that the built-in model gives, if a device with this model has just introduced
    /// itself.
    fn set_model_rate(&mut self) {
        let announced = self.port.announced.take();
        if let Some(known) = &self.model_rate
            && announced == Some(known.model)
        {
            self.driver.core.set_model_rate(known.rate);
        }
    }

    /// Queues the bytes that the recorder has collected. Returns whether the file still accepts
    /// bytes.
    fn write(&mut self) -> bool {
        self.file.append(self.port.recorder.take())
    }

    fn progress_text(&self) -> String {
        let summary = self.driver.core.summary();
        let time = FormattedDuration(self.start.elapsed());
        let bytes = DecimalBytes(self.port.recorder.bytes());
        let absent = if self.driver.connection.is_open() { "" } else { ", waiting for the device" };
        format!(
            "{time}, {bytes}, {} codes, {} packed blocks, {} lost{absent}",
            summary.received,
            summary.packed.received,
            summary.lost + summary.packed.lost
        )
    }
}

/// Records the commands that the core sends, and queues them for the port. Ignores the core's other
/// effects, because `record` publishes nothing.
struct RecordedPort {
    recorder: Recorder,
    outgoing: Vec<u8>,
    /// Model id of a device that has just introduced itself, until the main loop takes it.
    announced: Option<[u8; 8]>,
}

impl PortEffects for RecordedPort {
    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    fn note(&mut self, event: Event, bytes: &[u8], at: HostTime) {
        match event {
            Event::Opened => self.recorder.opened(at),
            Event::Bytes(_) => self.recorder.received(bytes, at),
            Event::Closed => self.recorder.closed(at),
        }
    }
}

impl Effects for RecordedPort {
    fn send(&mut self, frame: &[u8]) {
        self.recorder.sent(frame, HostTime::now());
        self.outgoing.extend_from_slice(frame);
    }

    fn announce(&mut self, announcement: &Announcement) {
        self.announced = Some(announcement.device.model_id);
    }
}

/// Interval at which the operating system is made to write received bytes to the disk.
const SYNC_INTERVAL: Duration = Duration::from_secs(1);
/// Number of chunks that can wait for the disk: about a minute of all streams. When the queue is
/// full, the port is not read, and the device counts the frames that it cannot send.
const QUEUE_CHUNKS: usize = 8192;

/// A new file, written by a thread of its own so that a slow disk does not delay reading the port.
#[derive(Debug)]
pub(crate) struct RecordingFile {
    path: PathBuf,
    chunks: SyncSender<Vec<u8>>,
    thread: JoinHandle<io::Result<()>>,
}

impl RecordingFile {
    /// Creates the file; replaces an existing one only with [`Existing::Replace`].
    ///
    /// # Errors
    ///
    /// [`BridgeError::NewFile`] if the file exists or cannot be created; [`BridgeError::System`] if
    /// no thread can be started.
    pub(crate) fn create(path: &Path, existing: Existing) -> Result<RecordingFile, BridgeError> {
        let file = GrowingFile::create(path, existing)?;
        let (chunks, receiver) = sync_channel(QUEUE_CHUNKS);
        let thread = std::thread::Builder::new()
            .name("recording".to_owned())
            .spawn(move || append_all(file, &receiver))?;
        Ok(RecordingFile { path: path.to_owned(), chunks, thread })
    }

    /// Queues bytes for the file, and waits while the queue is full. Returns whether the file still
    /// accepts bytes; if not, [`RecordingFile::finish`] returns the reason.
    pub(crate) fn append(&self, bytes: Vec<u8>) -> bool {
        bytes.is_empty() || self.chunks.send(bytes).is_ok()
    }

    /// Queues bytes for the file as [`RecordingFile::append`] does, but never waits.
    pub(crate) fn offer(&self, bytes: Vec<u8>) -> Offer {
        if bytes.is_empty() {
            return Offer::Taken;
        }
        match self.chunks.try_send(bytes) {
            Ok(()) => Offer::Taken,
            Err(TrySendError::Full(_)) => Offer::Lost,
            Err(TrySendError::Disconnected(_)) => Offer::Closed,
        }
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
        ended.map_err(|source| BridgeError::FileWrite(self.path, source))
    }
}

/// What happened to bytes that were offered to a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Offer {
    Taken,
    /// The queue is full, because the disk is too slow.
    Lost,
    /// The file takes no more bytes; [`RecordingFile::finish`] returns the reason.
    Closed,
}

/// Appends each chunk as it arrives, so that it survives the end of this process. Once a second,
/// waits until the disk holds everything, so that it also survives a loss of power.
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
