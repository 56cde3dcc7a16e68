//! The records with which a recording begins if the device is already streaming.

use std::collections::VecDeque;
use std::mem::{Discriminant, discriminant};

use bridge_core::HostTime;
use link::{Ack, AckResult, Decoder, Frame, Header, MAX_FRAME, ToDevice, ToHost, VERSION};

use crate::recording::introduction::Introduction;
use crate::recording::recorder::Recorder;

/// Number of commands that can wait for their acknowledgement.
const MAX_SENT: usize = 32;

/// Stores the newest introduction of a device and the commands that the device has acknowledged. A
/// recording that begins in the middle of a stream must start with them.
///
/// The caller passes in everything that it sends and receives, even while it is not recording.
#[derive(Debug, Default)]
pub struct Handshake {
    is_open: bool,
    introduction: Introduction,
    /// Commands without an acknowledgement, oldest first.
    sent: VecDeque<Command>,
    /// The newest acknowledged command of each kind, with its result, oldest first.
    acknowledged: Vec<(Command, AckResult)>,
    is_running: bool,
    /// Sequence number and device time of the newest frame from the device, and when it was
    /// received, microseconds of the host's monotonic clock.
    seq: u32,
    device_us: u64,
    received_us: i64,
}

#[derive(Debug)]
struct Command {
    seq: u32,
    kind: Discriminant<ToDevice<'static>>,
    frame: Vec<u8>,
}

impl Handshake {
    /// Notes that the port was opened. Opening the port does not stop a device that is streaming.
    pub fn opened(&mut self) {
        self.is_open = true;
        self.sent.clear();
    }

    /// Notes that the port was closed or lost.
    pub fn closed(&mut self) {
        self.is_open = false;
    }

    /// Notes a command that was sent to the device.
    pub fn sent(&mut self, frame: &[u8]) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let Some(Ok(decoded)) = decoder.next::<ToDevice>(&mut &frame[..]) else {
            return;
        };
        let kept = matches!(
            decoded.message,
            ToDevice::Identify
                | ToDevice::Stop
                | ToDevice::Start(_)
                | ToDevice::SetRate { .. }
                | ToDevice::SetExclusion(_)
                | ToDevice::SetFeatures(_)
        );
        if !kept {
            return;
        }
        if self.sent.len() == MAX_SENT {
            self.sent.pop_front();
        }
        self.sent.push_back(Command {
            seq: decoded.header.seq,
            kind: discriminant(&decoded.message.without_bytes()),
            frame: frame.to_vec(),
        });
    }

    /// Notes a frame from the device that has just been received.
    pub fn received(&mut self, frame: &Frame<ToHost>) {
        self.seq = frame.header.seq;
        self.device_us = frame.header.device_time_us;
        self.received_us = HostTime::now().monotonic_us;
        match &frame.message {
            ToHost::Hello(hello) => {
                if !self.introduction.is_session(hello) {
                    self.acknowledged.clear();
                    self.is_running = false;
                }
                self.introduce(frame);
            }
            ToHost::Substitutes(_) | ToHost::Capabilities(_) | ToHost::Converters(_) => {
                self.introduce(frame);
            }
            ToHost::Ack(ack) => self.acknowledge(*ack),
            _ => {}
        }
    }

    fn introduce(&mut self, frame: &Frame<ToHost>) {
        let mut buffer = [0; MAX_FRAME];
        if let Ok(bytes) = link::encode(&frame.header, &frame.message, &mut buffer) {
            self.introduction.note(bytes);
        }
    }

    fn acknowledge(&mut self, ack: Ack) {
        let Some(place) = self.sent.iter().position(|command| command.seq == ack.of) else {
            return;
        };
        let Some(command) = self.sent.remove(place) else {
            return;
        };
        let kind = command.kind;
        self.acknowledged.retain(|(known, _)| known.kind != kind);
        if kind == discriminant(&ToDevice::Stop) {
            self.is_running = false;
        } else if is_start(&command) && ack.result == AckResult::Done {
            self.is_running = true;
        }
        self.acknowledged.push((command, ack.result));
    }

    /// Writes the first records of a recording, all with the time `now`: a record that the port is
    /// open, the device's introduction, and the acknowledged commands with their results. If the
    /// device is streaming, the record `joined` follows.
    pub fn begin(&self, recorder: &mut Recorder, now: HostTime) {
        if !self.is_open {
            return;
        }
        recorder.opened(now);
        if !self.introduction.is_complete() {
            return;
        }
        let introduction = self.introduction.payloads();
        // Advance the device time: a stopped device may have sent nothing for seconds.
        let since_us = now.monotonic_us.saturating_sub(self.received_us);
        let frames = introduction.len() + self.acknowledged.len();
        let mut header = Header {
            version: VERSION,
            seq: self.seq.wrapping_sub(u32::try_from(frames).unwrap_or(0)).wrapping_add(1),
            device_time_us: self.device_us.saturating_add_signed(since_us),
        };
        let mut receive = |recorder: &mut Recorder, message: &ToHost| {
            let mut buffer = [0; MAX_FRAME];
            if let Ok(bytes) = link::encode(&header, message, &mut buffer) {
                recorder.received(bytes, now);
            }
            header.seq = header.seq.wrapping_add(1);
        };
        let identify = discriminant(&ToDevice::Identify);
        let (first, others): (Vec<_>, Vec<_>) =
            self.acknowledged.iter().partition(|(command, _)| command.kind == identify);
        for (command, _) in &first {
            recorder.sent(&command.frame, now);
        }
        for payload in &introduction {
            let mut decoder = Decoder::<MAX_FRAME>::new();
            if let Some(Ok(frame)) = decoder.next::<ToHost>(&mut &payload[..]) {
                receive(recorder, &frame.message);
            }
        }
        for (command, result) in first.into_iter().chain(others) {
            if command.kind != identify {
                recorder.sent(&command.frame, now);
            }
            let (of, result) = (command.seq, *result);
            receive(recorder, &ToHost::Ack(Ack { of, result }));
        }
        if self.is_running {
            recorder.joined(now);
        }
    }
}

fn is_start(command: &Command) -> bool {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let frame = decoder.next::<ToDevice>(&mut &command.frame[..]);
    frame.is_some_and(|frame| frame.is_ok_and(|of| matches!(of.message, ToDevice::Start(_))))
}
