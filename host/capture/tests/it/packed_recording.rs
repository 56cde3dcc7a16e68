//! Makes recordings of packed blocks in virtual time.

use capture::{FileHeader, Recorder};
use link::{
    Encoder, Event, EventKind, Flags, MAX_FRAME, PackedCode, Start, Stats, Streams, ToDevice,
    ToHost,
};

use crate::board::{Board, at};
use crate::packed_block::block;

/// Duration of a hop, microseconds.
pub(crate) const HOP_US: i64 = 62_500;

/// A recording that a test makes step by step.
pub(crate) struct PackedRecording {
    board: Board,
    host: Encoder,
    recorder: Recorder,
    streams: Streams,
    /// Present host time, microseconds.
    pub(crate) now_us: i64,
    /// Host time at which the device started, microseconds.
    boot_us: i64,
    /// Index of the next packed block.
    next: u32,
    events: u32,
}

impl PackedRecording {
    /// Starts to record a device that sends `streams`.
    pub(crate) fn new(board: Board, streams: Streams) -> PackedRecording {
        let header = FileHeader { created_ns: at(0).wall_ns, streams, mains_hz: 0 };
        let mut recording = PackedRecording {
            board,
            host: Encoder::default(),
            recorder: Recorder::new(header),
            streams,
            now_us: 1_000_000,
            boot_us: -3_000_000,
            next: 0,
            events: 0,
        };
        recording.recorder.opened(at(recording.now_us));
        recording.command(ToDevice::Identify);
        recording.start();
        recording
    }

    fn start(&mut self) {
        self.command(ToDevice::Stop);
        self.command(ToDevice::Start(Start { streams: self.streams, mains_hz: 0 }));
        (self.next, self.events) = (0, 0);
    }

    /// Records a command of the host and the device's answers.
    fn command(&mut self, command: ToDevice) {
        let mut buffer = [0; MAX_FRAME];
        let bytes = self.host.encode(0, &command, &mut buffer).unwrap().to_vec();
        self.now_us += 1_000;
        self.recorder.sent(&bytes, at(self.now_us));
        let answers = self.board.answer(&bytes);
        self.now_us += 1_000;
        self.recorder.received(&answers, at(self.now_us));
    }

    /// Returns the present device time, microseconds.
    fn device_us(&self) -> u64 {
        (self.now_us - self.boot_us).unsigned_abs()
    }

    fn send(&mut self, message: &ToHost) {
        self.send_at(self.device_us(), message);
    }

    fn send_at(&mut self, device_us: u64, message: &ToHost) {
        let frame = self.board.frame(device_us, message);
        self.recorder.received(&frame, at(self.now_us));
    }

    /// Advances time by a hop: the device sends a packed block, and a code if it streams codes.
    pub(crate) fn hop(&mut self) {
        let bytes = block(self.next, 0, 4);
        self.hop_of(&bytes);
    }

    /// Advances time by a hop, in which the device sends a packed block with these bytes.
    pub(crate) fn hop_of(&mut self, bytes: &[u8]) {
        self.now_us += HOP_US;
        self.send(&ToHost::PackedCode(PackedCode {
            block: self.next,
            rate: 4,
            flags: Flags::empty(),
            clipped: 0,
            saturated: 0,
            bytes,
        }));
        self.next += 1;
        if self.streams.contains(Streams::CODES) {
            let code = self.board.code(self.device_us(), 1);
            self.recorder.received(&code, at(self.now_us));
        }
    }

    /// Sends the device's `Stats`, as it does every second.
    pub(crate) fn stats(&mut self) {
        let stats = Stats {
            streams: self.streams,
            next_window: self.next,
            codes_made: self.next,
            ..Stats::default()
        };
        self.send(&ToHost::Stats(stats));
    }

    /// Sends the event of a rising edge of the trigger input, which happened `ago_us` microseconds
    /// ago.
    pub(crate) fn event(&mut self, ago_us: u64) {
        let event = Event { kind: EventKind::TriggerRise, number: self.events, sample: 0 };
        self.events += 1;
        self.send_at(self.device_us() - ago_us, &ToHost::Event(event));
    }

    /// Restarts the device after `outage_us` microseconds; its clock and indices start again.
    pub(crate) fn restart(&mut self, outage_us: i64) {
        self.now_us += outage_us;
        self.boot_us = self.now_us;
        self.board.reboot();
        let hello = self.board.hello();
        self.recorder.received(&hello, at(self.now_us));
        self.start();
    }

    /// Returns the file as a loss of power leaves it: without the records that end a recording.
    pub(crate) fn cut_off(mut self) -> Vec<u8> {
        self.recorder.take()
    }

    /// Ends the recording and returns the file.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        self.recorder.ending(at(self.now_us));
        self.command(ToDevice::Stop);
        self.cut_off()
    }
}
