//! A core with a simulated board, and a recorder of everything that the core requests.

use std::sync::Arc;

use bridge_core::{
    AnnouncedStream, Announcement, AuditedWindow, Core, Effects, EventPlace, EventStamps,
    FillerPolicy, ImpedanceReport, Model, Settings, StampPoint, TimedCode, TimedPackedBlock,
};
use link::{CodeValues, Streams, ToDevice, ToHost};
use neuro_ros::{
    DiagnosticLevel, DiagnosticStatus, NeuroEvent, NeuroFrame, NeuroOutput, Shape, TriWords,
};

use crate::board::{Board, at, model};

pub(crate) const SETTINGS: Settings = Settings {
    stamp: StampPoint::First,
    mains_hz: 0,
    filler: FillerPolicy::Last,
    low_latency: false,
    announced: AnnouncedStream::Encoded,
    streams: Streams::CODES,
    packed_rate: None,
    event_stamps: EventStamps::Scalp,
};

/// Records everything that the core requests. Checks each frame's shape, number and stamp.
#[derive(Default)]
pub(crate) struct Recorder {
    pub(crate) sent: Vec<u8>,
    pub(crate) announced: Vec<Announcement>,
    pub(crate) encoded: Vec<NeuroFrame>,
    pub(crate) windows: Vec<TimedCode>,
    pub(crate) blocks: Vec<TimedPackedBlock>,
    /// Number of blocks recorded so far, at each call of `finish_blocks`.
    pub(crate) finished: Vec<usize>,
    pub(crate) raw: Vec<NeuroFrame>,
    pub(crate) filtered: Vec<NeuroFrame>,
    pub(crate) predictions: Vec<NeuroOutput>,
    pub(crate) events: Vec<NeuroEvent>,
    pub(crate) places: Vec<EventPlace>,
    pub(crate) audits: Vec<AuditedWindow>,
    /// Number of measurements of impedances.
    pub(crate) impedances: usize,
}

impl Effects for Recorder {
    fn send(&mut self, frame: &[u8]) {
        self.sent.extend_from_slice(frame);
    }

    fn announce(&mut self, announcement: &Announcement) {
        self.announced.push(announcement.clone());
    }

    fn publish_encoded(&mut self, frame: &NeuroFrame) {
        assert_eq!(Shape::from_frame(frame).unwrap().nchannels, [128, 0, 8]);
        keep(&mut self.encoded, frame);
    }

    fn decode_block(&mut self, block: TimedPackedBlock) {
        self.blocks.push(block);
    }

    fn finish_blocks(&mut self) {
        self.finished.push(self.blocks.len());
    }

    fn decode(&mut self, window: TimedCode) {
        self.windows.push(window);
    }

    fn publish_raw(&mut self, frame: &NeuroFrame) {
        keep(&mut self.raw, frame);
    }

    fn publish_filtered(&mut self, frame: &NeuroFrame) {
        keep(&mut self.filtered, frame);
    }

    fn publish_prediction(&mut self, prediction: &NeuroOutput, _: TriWords) {
        self.predictions.push(prediction.clone());
    }

    fn publish_event(&mut self, event: &NeuroEvent, place: EventPlace) {
        assert_eq!(event.neuroheader.seq as usize, self.events.len() + 1);
        assert_eq!(event.header.seq, event.neuroheader.seq);
        self.events.push(event.clone());
        self.places.push(place);
    }

    fn publish_impedance(&mut self, _: &ImpedanceReport) {
        self.impedances += 1;
    }

    fn audit(&mut self, window: AuditedWindow) {
        self.audits.push(window);
    }
}

/// Checks that a frame has the shape of the first frame, the next sequence number and a later stamp
/// than the frame before, and records it.
fn keep(frames: &mut Vec<NeuroFrame>, frame: &NeuroFrame) {
    let shape = Shape::from_frame(frames.first().unwrap_or(frame)).unwrap();
    shape.admit(frame).unwrap();
    let before = frames
        .last()
        .map_or((0, 0), |frame| (frame.neuroheader.seq, frame.header.stamp.nanoseconds()));
    assert_eq!(frame.neuroheader.seq, before.0 + 1);
    assert_eq!(frame.header.seq, frame.neuroheader.seq);
    assert!(frame.header.stamp.nanoseconds() > before.1, "a stamp went backwards");
    frames.push(frame.clone());
}

/// A core and a simulated board that exchange bytes in virtual time.
pub(crate) struct Harness {
    pub(crate) core: Core,
    pub(crate) board: Board,
    pub(crate) recorder: Recorder,
    pub(crate) now_us: i64,
}

impl Harness {
    /// Creates a harness whose board is identified and streams.
    pub(crate) fn streaming(settings: Settings, board: Board) -> Harness {
        let harness = Harness::connected(settings, board);
        assert_eq!(commands(&harness), ["identify", "stop", "start"]);
        harness
    }

    /// Creates a harness whose board has answered the first commands, perhaps with a refusal.
    pub(crate) fn connected(settings: Settings, board: Board) -> Harness {
        let mut harness = Harness::new(settings, board);
        harness.connect();
        harness
    }

    pub(crate) fn new(settings: Settings, board: Board) -> Harness {
        Harness::with_model(settings, model(), board)
    }

    /// Creates a harness whose core has `model` and is not connected yet.
    pub(crate) fn with_model(settings: Settings, model: Arc<Model>, board: Board) -> Harness {
        Harness {
            core: Core::new(settings, Some(model)),
            board,
            recorder: Recorder::default(),
            now_us: 1_000_000,
        }
    }

    pub(crate) fn connect(&mut self) {
        self.open();
        self.exchange();
    }

    /// Lets core and board exchange bytes until the core has nothing more to send.
    pub(crate) fn exchange(&mut self) {
        while !self.recorder.sent.is_empty() {
            self.exchange_once();
        }
    }

    /// Delivers what the core has sent to the board, and the board's answers to the core.
    pub(crate) fn exchange_once(&mut self) {
        let answers = self.answers();
        self.receive(&answers);
    }

    /// Delivers what the core has sent to the board. Returns the board's answers.
    pub(crate) fn answers(&mut self) -> Vec<u8> {
        let commands = std::mem::take(&mut self.recorder.sent);
        self.board.answer(&commands)
    }

    /// Opens the port, but does not deliver the core's bytes to the board yet.
    pub(crate) fn open(&mut self) {
        self.core.connected(at(self.now_us), &mut self.recorder);
    }

    /// Lets the core send the command that is due, if any.
    pub(crate) fn tick(&mut self) {
        self.core.tick(at(self.now_us), &mut self.recorder);
    }

    /// Starts or stops the streams, as the user would.
    pub(crate) fn set_streaming(&mut self, is_wanted: bool) {
        self.core.set_streaming(is_wanted);
        self.tick();
        self.exchange();
    }

    /// Restarts the board. After `outage_us` microseconds the board introduces itself again.
    pub(crate) fn reboot(&mut self, outage_us: i64) {
        self.board.reboot();
        self.now_us += outage_us;
        let hello = self.board.hello();
        self.receive(&hello);
        self.exchange();
    }

    /// Delivers a `Stats` message in which the board states that it streams `streams`.
    pub(crate) fn stats(&mut self, streams: Streams) {
        let stats = self.board.stats(streams);
        self.receive(&stats);
    }

    /// Lets the board answer until it streams. The acknowledgement of `Start` is lost on the way.
    pub(crate) fn start_unacknowledged(&mut self) {
        while !self.board.streaming {
            let answers = self.answers();
            if !self.board.streaming {
                self.receive(&answers);
            }
        }
    }

    pub(crate) fn receive(&mut self, bytes: &[u8]) {
        self.core.receive(bytes, at(self.now_us), &mut self.recorder);
    }

    /// Advances time by 62.5 ms, in which the board makes a code whose values are all `value`. The
    /// code reaches the core unless it is `lost`.
    pub(crate) fn code(&mut self, value: i8, lost: bool) {
        self.now_us += 62_500;
        let bytes = self.board.code(self.now_us.unsigned_abs(), value);
        if !lost {
            self.receive(&bytes);
        }
    }

    /// Delivers `count` codes whose values are all `value`, 62.5 ms apart.
    pub(crate) fn codes(&mut self, count: u64, value: i8) {
        (0..count).for_each(|_| self.code(value, false));
    }

    /// Advances time by `count` hops. The core receives none of their codes.
    pub(crate) fn lose(&mut self, count: u64) {
        (0..count).for_each(|_| self.code(1, true));
    }

    /// Advances time by 62.5 ms, in which the board makes and delivers a code with `values`.
    pub(crate) fn code_of(&mut self, values: &CodeValues) {
        self.now_us += 62_500;
        let bytes = self.board.code_of(self.now_us.unsigned_abs(), values);
        self.receive(&bytes);
    }

    /// Delivers to the core a message that the board made at device time `device_us`.
    pub(crate) fn send(&mut self, device_us: u64, message: &ToHost) {
        let bytes = self.board.frame(device_us, message);
        self.receive(&bytes);
    }

    /// Makes a new report and returns its status `corticode: {part}`; `None` if it is absent.
    pub(crate) fn status(&mut self, part: &str) -> Option<DiagnosticStatus> {
        let statuses = self.core.diagnostics(at(self.now_us)).status;
        let name = format!("corticode: {part}");
        statuses.into_iter().find(|status| status.name == name)
    }

    /// Delivers a message, then makes a new report and returns its status `corticode: {part}`.
    pub(crate) fn status_after(&mut self, message: &ToHost, part: &str) -> DiagnosticStatus {
        self.send(0, message);
        self.status(part).unwrap()
    }

    /// Makes a new report and returns the value `key` of its status `corticode: {part}`.
    pub(crate) fn figure(&mut self, part: &str, key: &str) -> String {
        value(&self.status(part).unwrap(), key).to_owned()
    }

    /// Makes a new report and returns its status `corticode: {part}` as text.
    pub(crate) fn report(&mut self, part: &str) -> String {
        format!("{:?}", self.status(part).unwrap())
    }

    /// Returns, for each announcement, oldest first, whether it describes a stream.
    pub(crate) fn described(&self) -> Vec<bool> {
        let announced = self.recorder.announced.iter();
        announced.map(|device| device.info.is_some()).collect()
    }

    /// Returns, for each frame on `/encoded`, oldest first, whether it is a filler.
    pub(crate) fn fillers(&self) -> Vec<bool> {
        fillers(&self.recorder.encoded)
    }
}

/// Returns the names of the commands that the board received, oldest first.
pub(crate) fn commands(harness: &Harness) -> Vec<&'static str> {
    let name = |(_, command): &(u32, ToDevice)| match command {
        ToDevice::Start(_) => "start",
        ToDevice::Stop => "stop",
        ToDevice::Identify => "identify",
        ToDevice::Ping => "ping",
        ToDevice::SelfTest => "self-test",
        ToDevice::SyncTime { .. } => "sync time",
        ToDevice::Reset(_) => "reset",
        ToDevice::SetRate { .. } => "set rate",
        ToDevice::SetExclusion(_) => "set exclusion",
        ToDevice::ModelBegin(_) => "model begin",
        ToDevice::ModelChunk(_) => "model chunk",
        ToDevice::ModelEnd => "model end",
        ToDevice::SetFeatures(_) => "set features",
        ToDevice::SetImpedance { .. } => "set impedance",
    };
    harness.board.received.iter().map(name).collect()
}

/// Returns the value that belongs to `key` in a status.
pub(crate) fn value<'a>(status: &'a DiagnosticStatus, key: &str) -> &'a str {
    let mut values = status.values.iter();
    let found = values.find(|value| value.key == key);
    &found.unwrap_or_else(|| panic!("no {key} in {status:?}")).value
}

/// Returns the stamp of each frame, nanoseconds since 1970.
pub(crate) fn stamps(frames: &[NeuroFrame]) -> Vec<i64> {
    let stamps = frames.iter().map(|frame| frame.header.stamp.nanoseconds());
    stamps.collect()
}

/// Checks that the stamps of consecutive frames are 62.5 ms (one hop) apart.
#[track_caller]
pub(crate) fn assert_evenly_spaced(frames: &[NeuroFrame]) {
    for pair in stamps(frames).windows(2) {
        assert_eq!(pair[1] - pair[0], 62_500_000);
    }
}

/// Returns, for each sample in the frames, whether it is a filler.
pub(crate) fn fillers(frames: &[NeuroFrame]) -> Vec<bool> {
    let rows = frames.iter().flat_map(|frame| frame.tri.data.chunks(8));
    rows.map(|words| words[0] & 0x8000 != 0).collect()
}

/// Returns the level and the message of a status.
pub(crate) fn state(status: &DiagnosticStatus) -> (DiagnosticLevel, &str) {
    (status.level, &status.message)
}
