//! Decodes the frames that the virtual board sends, into data that tests can keep.

use link::{
    Ack, Converters, Decoder, Event, Flags, Header, MAX_FRAME, ResetCause, SelfTest, Stats, Timing,
    ToHost,
};

/// A decoded frame that the device has sent.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Sequence number, which the device increments with each frame.
    pub seq: u32,
    /// Device time at which the frame was made, in us since boot.
    pub device_us: u64,
    /// Message in the frame, with the data that tests use.
    pub kind: Kind,
}

/// A code that the device has sent, in a message `Code` or `PackedCode`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReceivedCode {
    /// Faults and other conditions that the device flagged in the code's window.
    pub flags: Flags,
    /// The message, encoded again as frame 0 at device time 0, so that tests can compare codes.
    pub bytes: Vec<u8>,
}

/// A message to the host as owned data; only those variants of [`ToHost`] that tests use.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "the variants are documented in `link`")]
pub enum Kind {
    Hello {
        board: String,
        model_id: [u8; 8],
        session_id: u32,
        reset_cause: ResetCause,
        fault: String,
    },
    Capabilities,
    Code(ReceivedCode),
    PackedCode(ReceivedCode),
    /// The message, encoded again as in [`ReceivedCode::bytes`].
    CompressedRaw(Vec<u8>),
    Features(Vec<u8>),
    /// Impedance of each electrode in ohms; `None` for an open electrode.
    Impedance(Vec<Option<u32>>),
    Stats(Box<Stats>),
    Ack(Ack),
    Timing(Box<Timing>),
    Event(Event),
    Converters(Box<Converters>),
    SelfTest(Box<SelfTest>),
    /// `values` is the number of values in the audited code.
    Audit {
        window: u32,
        planes: Vec<u8>,
        values: usize,
    },
    /// Any message that has no variant here.
    Other,
}

/// Decodes the bytes that the device sends and stores the frames.
#[derive(Debug)]
pub struct Inbox {
    decoder: Decoder<MAX_FRAME>,
    frames: Vec<Frame>,
    errors: Vec<String>,
}

impl Default for Inbox {
    fn default() -> Self {
        Self { decoder: Decoder::new(), frames: Vec::new(), errors: Vec::new() }
    }
}

impl Inbox {
    /// Decodes the next bytes from the device; a frame may be split across calls.
    pub fn decode(&mut self, mut bytes: &[u8]) {
        while let Some(outcome) = self.decoder.next::<ToHost<'_>>(&mut bytes) {
            match outcome {
                Ok(frame) => self.frames.push(Frame {
                    seq: frame.header.seq,
                    device_us: frame.header.device_time_us,
                    kind: Kind::from_message(&frame.message),
                }),
                Err(error) => self.errors.push(format!("{error:?}")),
            }
        }
    }

    /// Returns all frames received so far, in order.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Returns the errors of all frames that could not be decoded.
    pub fn decode_errors(&self) -> &[String] {
        &self.errors
    }

    /// Returns an iterator over the network's codes received so far, in order.
    pub fn codes(&self) -> impl Iterator<Item = (&Frame, &ReceivedCode)> {
        self.frames.iter().filter_map(|frame| match &frame.kind {
            Kind::Code(code) => Some((frame, code)),
            _ => None,
        })
    }
}

impl Kind {
    fn from_message(message: &ToHost<'_>) -> Self {
        match message {
            ToHost::Hello(hello) => Self::Hello {
                board: hello.board.to_owned(),
                model_id: hello.model_id,
                session_id: hello.session_id,
                reset_cause: hello.reset_cause,
                fault: hello.fault.to_owned(),
            },
            ToHost::Capabilities(_) => Self::Capabilities,
            ToHost::Code(code) => {
                Self::Code(ReceivedCode { flags: code.flags, bytes: encoded(message) })
            }
            ToHost::PackedCode(code) => {
                Self::PackedCode(ReceivedCode { flags: code.flags, bytes: encoded(message) })
            }
            ToHost::Features(_) => Self::Features(encoded(message)),
            ToHost::Impedance(impedance) => Self::Impedance(impedance.electrodes().collect()),
            ToHost::CompressedRaw(_) => Self::CompressedRaw(encoded(message)),
            ToHost::Stats(stats) => Self::Stats(Box::new(*stats)),
            ToHost::Ack(ack) => Self::Ack(*ack),
            ToHost::Timing(timing) => Self::Timing(Box::new(timing.clone())),
            ToHost::Event(event) => Self::Event(*event),
            ToHost::Converters(converters) => Self::Converters(Box::new(converters.clone())),
            ToHost::SelfTest(test) => Self::SelfTest(Box::new(test.clone())),
            ToHost::Audit(audit) => Self::Audit {
                window: audit.window,
                planes: audit.planes.to_vec(),
                values: audit.values.len(),
            },
            _ => Self::Other,
        }
    }
}

/// Encodes a message as frame 0 at device time 0, so that equal messages give equal bytes.
fn encoded(message: &ToHost<'_>) -> Vec<u8> {
    let header = Header { version: link::VERSION, seq: 0, device_time_us: 0 };
    let mut buffer = [0; MAX_FRAME];
    link::encode(&header, message, &mut buffer).map(<[u8]>::to_vec).unwrap_or_default()
}
