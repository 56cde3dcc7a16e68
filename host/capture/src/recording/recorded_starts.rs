//! The `Start` commands of a recording, and their acknowledgements.

use std::collections::HashMap;

use link::{Ack, AckResult, Decoder, MAX_FRAME, Streams, ToDevice, ToHost};

/// The commands of the recorded host so far, by number: the streams that a `Start` asked for, `None`
/// for every other command.
#[derive(Debug, Default)]
pub(crate) struct RecordedStarts(HashMap<u32, Option<Streams>>);

impl RecordedStarts {
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Notes the command in the bytes of a frame to the device.
    pub(crate) fn note(&mut self, mut payload: &[u8]) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        if let Some(Ok(frame)) = decoder.next::<ToDevice>(&mut payload) {
            let streams = match frame.message {
                ToDevice::Start(start) => Some(start.streams),
                _ => None,
            };
            self.0.insert(frame.header.seq, streams);
        }
    }

    /// Returns the streams of the `Start` that the bytes of a frame from the device acknowledge; `None`
    /// if they acknowledge none.
    pub(crate) fn acknowledged_by(&self, mut payload: &[u8]) -> Option<Streams> {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        match decoder.next::<ToHost>(&mut payload)?.ok()?.message {
            ToHost::Ack(Ack {
                of,
                result: AckResult::Done,
            }) => self.0.get(&of).copied().flatten(),
            _ => None,
        }
    }
}
