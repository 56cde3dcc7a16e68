//! A device that sends what a recording holds, and answers commands as the recorded device did.

use std::io::{Read, Seek};

use link::{
    Ack, AckResult, Decoder, Frame, Header, MAX_FRAME, Start, Stats, Streams, ToDevice, ToHost,
    VERSION,
};

use crate::recording::introduction::{Introduction, RecordedStarts};
use crate::recording::reader::RecordingReader;
use crate::recording::renumbering::Renumbering;
use crate::recording::{FileHeader, RecordKind, RecordingError};

/// How fast a recording is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The frames are sent at the intervals at which they were recorded.
    RealTime,
    /// Each frame is sent as soon as the host has read the frames before it.
    Fast,
}

/// Plays a recording as a device. Pure apart from reading the file: the caller passes in times and
/// the bytes from the host, and sends the host the bytes that [`Replayer::take`] returns.
///
/// A `Start` plays the recording from its beginning. Where the recorded device restarted, and its
/// host started the streams again, the replay waits for a `Start` from its own host.
#[derive(Debug)]
pub struct Replayer<R> {
    reader: RecordingReader<R>,
    pace: Pace,
    from_host: Decoder<MAX_FRAME>,
    from_device: Decoder<MAX_FRAME>,
    /// Newest introduction of the device up to the present position in the recording.
    introduction: Introduction,
    recorded_starts: RecordedStarts,
    renumbering: Renumbering,
    /// Streams that the recorded device sent at the present position in the recording.
    recorded_streams: Streams,
    outgoing: Vec<u8>,
    seq: u32,
    state: State,
    /// Streams that the replay's host asked for in its last `Start`.
    streams: Streams,
    /// Whether the recorded device has restarted, and the replay's host has not sent `Start` since.
    restarted: bool,
    /// Time in the recording at which the recorded device was started, microseconds.
    started_us: i64,
    /// Time on the host's clock minus time in the recording, microseconds; `None` until the first
    /// frame after a `Start` is played.
    offset_us: Option<i64>,
    /// Next frame to send: its time in the recording, microseconds, and its bytes.
    next: Option<(i64, Vec<u8>)>,
    /// Number (`seq`) of the newest recorded frame from the device.
    recorded_seq: Option<u32>,
    device_us: u64,
    next_window: u32,
    counts: ReplayCounts,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// The host has not sent `Start` yet, or has sent `Stop`.
    Stopped,
    Playing,
    /// The recorded device has restarted; the replay waits for the host's next `Start`.
    AwaitsStart,
}

impl<R: Read + Seek> Replayer<R> {
    /// Creates a replay, and reads the recording up to the introduction of the first device.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if `source` is not a recording, or no device introduces itself in it.
    pub fn new(source: R, pace: Pace) -> Result<Replayer<R>, RecordingError> {
        let mut replayer = Replayer {
            reader: RecordingReader::new(source)?,
            pace,
            from_host: Decoder::new(),
            from_device: Decoder::new(),
            introduction: Introduction::default(),
            recorded_starts: RecordedStarts::default(),
            renumbering: Renumbering::Off,
            recorded_streams: Streams::empty(),
            outgoing: Vec::new(),
            seq: 0,
            state: State::Stopped,
            streams: Streams::empty(),
            restarted: false,
            started_us: 0,
            offset_us: None,
            next: None,
            recorded_seq: None,
            device_us: 0,
            next_window: 0,
            counts: ReplayCounts::default(),
        };
        replayer.rewind()?;
        Ok(replayer)
    }

    /// Returns the header of the recording.
    pub fn header(&self) -> &FileHeader {
        self.reader.header()
    }

    /// Removes and returns the bytes to send to the host.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// Returns whether the recording was played to its end.
    pub fn is_finished(&self) -> bool {
        self.state == State::Playing && self.next.is_none()
    }

    /// Returns the numbers of frames, codes and packed blocks that were sent so far.
    pub fn counts(&self) -> ReplayCounts {
        self.counts
    }

    /// Returns when to send the next frame, microseconds of the host's clock; `None` unless
    /// playing.
    pub fn due_us(&self, now_us: i64) -> Option<i64> {
        let (State::Playing, Some((time_us, _))) = (self.state, &self.next) else {
            return None;
        };
        match (self.pace, self.offset_us) {
            (Pace::RealTime, Some(offset_us)) => Some(time_us.saturating_add(offset_us)),
            _ => Some(now_us),
        }
    }

    /// Handles bytes from the host, and answers its commands.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Read`] if the operating system cannot read the file.
    pub fn receive(&mut self, mut bytes: &[u8]) -> Result<(), RecordingError> {
        let mut commands = Vec::new();
        while let Some(outcome) = self.from_host.next::<ToDevice>(&mut bytes) {
            if let Ok(frame) = outcome {
                commands.push((frame.header.seq, frame.message.without_bytes()));
            }
        }
        for (of, command) in commands {
            let result = self.answer(command)?;
            self.send(&ToHost::Ack(Ack { of, result }));
        }
        Ok(())
    }

    /// Sends the frames that are due at `now_us`; with [`Pace::Fast`] one frame, due or not.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Read`] if the operating system cannot read the file.
    pub fn play(&mut self, now_us: i64) -> Result<(), RecordingError> {
        while let Some((time_us, payload)) = self.next.take_if(|_| self.state == State::Playing) {
            let started_us = self.started_us;
            let offset_us = *self.offset_us.get_or_insert(now_us.saturating_sub(started_us));
            if self.pace == Pace::RealTime && time_us.saturating_add(offset_us) > now_us {
                self.next = Some((time_us, payload));
                return Ok(());
            }
            self.pass_on(&payload, time_us);
            self.next = self.read_frame()?;
            if self.pace == Pace::Fast {
                return Ok(());
            }
        }
        Ok(())
    }

    fn answer(&mut self, command: ToDevice) -> Result<AckResult, RecordingError> {
        Ok(match command {
            ToDevice::Identify => {
                self.introduce();
                AckResult::Done
            }
            ToDevice::Ping => AckResult::Done,
            ToDevice::Start(start) => return self.start(start),
            ToDevice::Stop => {
                // After a restart the host sends `Stop` first, to make sure that nothing streams;
                // the replay keeps waiting for the host's `Start`.
                if !self.restarted {
                    self.state = State::Stopped;
                }
                let stats = Stats { next_window: self.next_window, ..Stats::default() };
                self.send(&ToHost::Stats(stats));
                AckResult::Done
            }
            ToDevice::SelfTest
            | ToDevice::SyncTime { .. }
            | ToDevice::Reset(_)
            | ToDevice::SetRate { .. }
            | ToDevice::SetExclusion(_)
            | ToDevice::SetImpedance { .. }
            | ToDevice::ModelBegin(_)
            | ToDevice::ModelChunk(_)
            | ToDevice::ModelEnd => AckResult::NotSupported,
            ToDevice::SetFeatures(_) => {
                // Accept any filters, although they change nothing: recorded features name the
                // filters that they come from.
                if self.recorded_streams.contains(Streams::FEATURES) {
                    AckResult::Done
                } else {
                    AckResult::NotSupported
                }
            }
        })
    }

    fn start(&mut self, start: Start) -> Result<AckResult, RecordingError> {
        let recorded = self.recorded_streams;
        // A `Start` for one of these streams is refused unless the recording has the stream.
        let exact = [
            Streams::CODES,
            Streams::RAW,
            Streams::COMPRESSED_RAW,
            Streams::FILTERED,
            Streams::PACKED,
            Streams::FEATURES,
        ];
        let is_missing =
            |stream: Streams| start.streams.contains(stream) && !recorded.contains(stream);
        let other_mains = ![0, self.introduction.mains_hz()].contains(&start.mains_hz);
        if other_mains || exact.into_iter().any(is_missing) {
            return Ok(AckResult::BadArgument);
        }
        match self.state {
            // While streams are running, a device ignores `Start`, and so does a replay.
            State::Playing => {}
            State::AwaitsStart => self.offset_us = None,
            State::Stopped => self.rewind()?,
        }
        self.state = State::Playing;
        self.restarted = false;
        self.streams = start.streams;
        Ok(AckResult::Done)
    }

    /// Goes back to the beginning of the recording: the first frame after the recorded `Start`.
    fn rewind(&mut self) -> Result<(), RecordingError> {
        self.reader.rewind()?;
        self.introduction = Introduction::default();
        self.recorded_starts.clear();
        self.renumbering = Renumbering::Off;
        self.recorded_streams = self.reader.header().streams;
        self.next_window = 0;
        self.offset_us = None;
        while let Some((time_us, payload)) = self.read_frame()? {
            self.introduction.note(&payload);
            self.note_seq(&payload);
            if let Some(streams) = self.recorded_starts.acknowledged_by(&payload) {
                self.recorded_streams = streams;
                self.started_us = time_us;
                break;
            }
        }
        if !self.introduction.is_complete() {
            return Err(RecordingError::NoDevice);
        }
        self.next = self.read_frame()?;
        Ok(())
    }

    /// Returns time and bytes of the next record from the device, and notes the commands before it.
    fn read_frame(&mut self) -> Result<Option<(i64, Vec<u8>)>, RecordingError> {
        while let Some(record) = self.reader.next_record()? {
            match record.kind {
                RecordKind::Received => {
                    return Ok(Some((record.time.monotonic_us, record.payload.to_vec())));
                }
                RecordKind::Sent => {
                    if self.recorded_starts.note(record.payload) {
                        self.renumbering = Renumbering::Off;
                    }
                }
                RecordKind::Joined => {
                    self.renumbering = Renumbering::joined(self.introduction.hop());
                }
                // The next records stop the recorded device; the replay's host sends `Stop` itself.
                RecordKind::Ending => return Ok(None),
                RecordKind::Opened
                | RecordKind::Closed
                | RecordKind::Marker
                | RecordKind::Newer(_) => {}
            }
        }
        Ok(None)
    }

    /// Sends a recorded frame or leaves it out. Where the recorded host started the device again
    /// after a restart, waits for the `Start` of the replay's host.
    fn pass_on(&mut self, payload: &[u8], time_us: i64) {
        let mut decoder = std::mem::take(&mut self.from_device);
        let mut bytes = payload;
        match decoder.next::<ToHost>(&mut bytes) {
            Some(Ok(frame)) => {
                let streams = self.recorded_starts.acknowledged_by(payload);
                if let Some(streams) = streams.filter(|_| self.restarted) {
                    self.recorded_streams = streams;
                    // The replay's host has to send `Start` at the same position in the recording.
                    self.state = State::AwaitsStart;
                    self.started_us = time_us;
                }
                self.pass_on_frame(&frame, payload);
            }
            Some(Err(_)) => self.counts.unusable += 1,
            // The record holds only zeros, or bytes of an unfinished frame.
            None => {}
        }
        decoder.reset();
        self.from_device = decoder;
    }

    fn pass_on_frame(&mut self, frame: &Frame<ToHost>, payload: &[u8]) {
        // A gap in the recorded sequence numbers becomes a gap in the replay's sequence numbers.
        let Header { seq, device_time_us, .. } = frame.header;
        let is_hello = matches!(frame.message, ToHost::Hello(_));
        let gap = match self.recorded_seq {
            Some(before) if !is_hello => seq.wrapping_sub(before).wrapping_sub(1),
            _ => 0,
        };
        // A lower sequence number than before is no gap: the device restarted and its `Hello` was
        // lost, or the recorded device was itself a replay.
        if gap < u32::MAX / 2 {
            self.seq = self.seq.wrapping_add(gap);
        }
        self.recorded_seq = Some(seq);
        self.device_us = device_time_us;
        let Some(message) = self.renumbering.apply(&frame.message) else {
            return;
        };
        match &message {
            ToHost::Hello(hello) if !self.introduction.is_session(hello) => {
                self.introduction.note(payload);
                self.next_window = 0;
                self.restarted = true;
                self.renumbering = Renumbering::Off;
                self.send(&message);
            }
            ToHost::Substitutes(_) | ToHost::Capabilities(_) | ToHost::Converters(_) => {
                self.introduction.note(payload);
                self.send(&message);
            }
            message if !self.is_wanted(message) => {}
            ToHost::Code(code) => {
                self.next_window = code.window.wrapping_add(1);
                self.counts.codes += 1;
                self.send(&message);
            }
            ToHost::PackedCode(_) => {
                self.counts.blocks += 1;
                self.send(&message);
            }
            message => self.send(message),
        }
    }

    /// Returns whether a message is for the replay's host: it belongs to a stream that the host
    /// asked for, and does not answer a command of the recorded host.
    fn is_wanted(&self, message: &ToHost) -> bool {
        match message {
            ToHost::Hello(_) | ToHost::Ack(_) | ToHost::ClockReading(_) | ToHost::SelfTest(_) => {
                false
            }
            ToHost::Code(_) => self.streams.contains(Streams::CODES),
            ToHost::CompressedRaw(_) => self.streams.contains(Streams::COMPRESSED_RAW),
            ToHost::PackedCode(_) => self.streams.contains(Streams::PACKED),
            ToHost::Features(_) => self.streams.contains(Streams::FEATURES),
            ToHost::Raw(_) => self.streams.contains(Streams::RAW),
            ToHost::Filtered(_) => self.streams.contains(Streams::FILTERED),
            ToHost::Audit(_) => self.streams.contains(Streams::AUDIT),
            ToHost::Event(_) => self.streams.contains(Streams::EVENTS),
            _ => true,
        }
    }

    /// Sends a message with the replay's next sequence number and the newest frame's device time.
    fn send(&mut self, message: &ToHost) {
        let header = Header { version: VERSION, seq: self.seq, device_time_us: self.device_us };
        self.seq = self.seq.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME];
        // Every message was read from a frame, so it fits into a frame.
        if let Ok(bytes) = link::encode(&header, message, &mut buffer) {
            self.outgoing.extend_from_slice(bytes);
            self.counts.frames += 1;
        }
    }

    fn introduce(&mut self) {
        for payload in self.introduction.payloads() {
            let mut bytes = &payload[..];
            let mut decoder = Decoder::<MAX_FRAME>::new();
            if let Some(Ok(frame)) = decoder.next::<ToHost>(&mut bytes) {
                self.send(&frame.message);
            }
        }
    }

    fn note_seq(&mut self, payload: &[u8]) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut bytes = payload;
        if let Some(Ok(frame)) = decoder.next::<ToHost>(&mut bytes) {
            self.recorded_seq = Some(frame.header.seq);
            self.device_us = frame.header.device_time_us;
        }
    }
}

/// Numbers of frames, codes and packed blocks that a replay sent, and of frames that it left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReplayCounts {
    /// Number of frames sent, including answers to commands.
    pub frames: u64,
    /// Number of codes sent.
    pub codes: u64,
    /// Number of packed blocks sent.
    pub blocks: u64,
    /// Number of recorded frames left out because they are damaged or newer than this program.
    pub unusable: u64,
}
