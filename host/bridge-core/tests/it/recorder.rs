//! A core with a simulated board, and a recorder of the core's effects.

use std::sync::Arc;

use bridge_core::{
    AnnouncedStream, Announcement, AuditedWindow, Core, Effects, EventStamps, FillerPolicy, Model,
    Settings, StampPoint, TimedCode, TimedPackedBlock,
};
use link::{CodeValues, Streams, ToDevice, ToHost};
use neuro_ros::{DiagnosticStatus, NeuroEvent, NeuroFrame, Shape};

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

/// Records every effect of the core. Checks shape, number and stamp of every frame.
#[derive(Default)]
pub(crate) struct Recorder {
    pub(crate) sent: Vec<u8>,
    pub(crate) announced: Vec<Announcement>,
    pub(crate) encoded: Vec<NeuroFrame>,
    pub(crate) windows: Vec<TimedCode>,
    pub(crate) blocks: Vec<TimedPackedBlock>,
    /// Numbers of blocks after which none followed.
    pub(crate) finished: Vec<usize>,
    pub(crate) raw: Vec<NeuroFrame>,
    pub(crate) filtered: Vec<NeuroFrame>,
    pub(crate) events: Vec<NeuroEvent>,
    pub(crate) audits: Vec<AuditedWindow>,
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

    fn publish_event(&mut self, event: &NeuroEvent) {
        assert_eq!(event.neuroheader.seq as usize, self.events.len() + 1);
        assert_eq!(event.header.seq, event.neuroheader.seq);
        self.events.push(event.clone());
    }

    fn audit(&mut self, window: AuditedWindow) {
        self.audits.push(window);
    }
}

/// Checks that a frame has the shape of the first frame and that its number and stamp increase, and
/// records it.
fn keep(frames: &mut Vec<NeuroFrame>, frame: &NeuroFrame) {
    let shape = Shape::from_frame(frames.first().unwrap_or(frame)).unwrap();
    shape.admit(frame).unwrap();
    let before = frames.last().map_or((0, 0), |frame| {
        (frame.neuroheader.seq, frame.header.stamp.nanoseconds())
    });
    assert_eq!(frame.neuroheader.seq, before.0 + 1);
    assert_eq!(frame.header.seq, frame.neuroheader.seq);
    assert!(
        frame.header.stamp.nanoseconds() > before.1,
        "a stamp went backwards"
    );
    frames.push(frame.clone());
}

/// A core and a board that exchange bytes in virtual time.
pub(crate) struct Harness {
    pub(crate) core: Core,
    pub(crate) board: Board,
    pub(crate) recorder: Recorder,
    pub(crate) now_us: i64,
}

impl Harness {
    /// Creates a harness whose board is already identified and streaming.
    pub(crate) fn streaming(settings: Settings, board: Board) -> Harness {
        let mut harness = Harness::new(settings, board);
        harness.connect();
        assert_eq!(
            harness.board.received.len(),
            3,
            "Identify, Stop, Start: {:?}",
            harness.board.received
        );
        harness
    }

    pub(crate) fn new(settings: Settings, board: Board) -> Harness {
        Harness::with_model(settings, model(), board)
    }

    /// Creates a harness whose bridge has `model`.
    pub(crate) fn with_model(settings: Settings, model: Arc<Model>, board: Board) -> Harness {
        Harness {
            core: Core::new(settings, Some(model)),
            board,
            recorder: Recorder::default(),
            now_us: 1_000_000,
        }
    }

    pub(crate) fn connect(&mut self) {
        self.core.connected(at(self.now_us), &mut self.recorder);
        self.exchange();
    }

    /// Exchanges bytes between core and board until the core has nothing more to send.
    pub(crate) fn exchange(&mut self) {
        loop {
            let commands = std::mem::take(&mut self.recorder.sent);
            if commands.is_empty() {
                return;
            }
            let answers = self.board.answer(&commands);
            self.receive(&answers);
        }
    }

    pub(crate) fn receive(&mut self, bytes: &[u8]) {
        self.core
            .receive(bytes, at(self.now_us), &mut self.recorder);
    }

    /// Advances time by 62.5 ms. The board makes a code with this value, which reaches the core
    /// unless `lost`.
    pub(crate) fn code(&mut self, value: i8, lost: bool) {
        self.now_us += 62_500;
        let bytes = self.board.code(self.now_us.unsigned_abs(), value);
        if !lost {
            self.receive(&bytes);
        }
    }

    /// Advances time by 62.5 ms. The board makes a code with these values, which reaches the core.
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

    /// Returns the status `corticode: {part}` of a new report; `None` if the report has no such
    /// status.
    pub(crate) fn status(&mut self, part: &str) -> Option<DiagnosticStatus> {
        let statuses = self.core.diagnostics(at(self.now_us)).status;
        let name = format!("corticode: {part}");
        statuses.into_iter().find(|status| status.name == name)
    }

    /// Returns, for each announcement from the oldest on, whether it describes a stream.
    pub(crate) fn described(&self) -> Vec<bool> {
        let announced = self.recorder.announced.iter();
        announced
            .map(|announced| announced.info.is_some())
            .collect()
    }

    /// Returns, for each frame on `/encoded` from the oldest on, whether the frame is a filler.
    pub(crate) fn fillers(&self) -> Vec<bool> {
        self.recorder
            .encoded
            .iter()
            .map(|frame| frame.tri.data[0] & 0x8000 != 0)
            .collect()
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
    };
    harness.board.received.iter().map(name).collect()
}
