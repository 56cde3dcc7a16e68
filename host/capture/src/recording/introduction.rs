//! What a replay remembers of the recorded frames: the introduction of the device, and the `Start`
//! commands of the recorded host.

use std::collections::HashMap;

use bridge_core::Identity;
use link::{Ack, AckResult, Decoder, Hello, MAX_FRAME, Streams, ToDevice, ToHost};

use crate::recording::renumbering::Hop;

/// The newest recorded frames in which a device introduces itself.
#[derive(Debug, Default)]
pub(crate) struct Introduction {
    identity: Option<Identity>,
    mains_hz: u8,
    hello: Option<Vec<u8>>,
    substitutes: Option<Vec<u8>>,
    capabilities: Option<Vec<u8>>,
    converters: Option<Vec<u8>>,
    hop: Option<Hop>,
}

impl Introduction {
    /// Stores the frame in `payload` if it is part of an introduction.
    pub(crate) fn note(&mut self, payload: &[u8]) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut bytes = payload;
        let Some(Ok(frame)) = decoder.next::<ToHost>(&mut bytes) else {
            return;
        };
        match frame.message {
            ToHost::Hello(hello) => {
                if !self.is_session(&hello) {
                    *self = Introduction::default();
                }
                self.identity = Some(Identity::new(&hello));
                self.hello = Some(payload.to_vec());
            }
            ToHost::Capabilities(capabilities) => {
                self.mains_hz = capabilities.mains_hz;
                self.hop = Hop::of(&capabilities);
                self.capabilities = Some(payload.to_vec());
            }
            ToHost::Substitutes(_) => self.substitutes = Some(payload.to_vec()),
            ToHost::Converters(_) => self.converters = Some(payload.to_vec()),
            _ => {}
        }
    }

    /// Returns whether the introduction is complete enough for a host to use the device's codes.
    pub(crate) fn is_complete(&self) -> bool {
        self.hello.is_some() && self.capabilities.is_some()
    }

    /// Returns whether `hello` comes from the introduced device, without a restart since then.
    pub(crate) fn is_session(&self, hello: &Hello) -> bool {
        let identity = self.identity.as_ref();
        identity.is_some_and(|identity| identity.is_same_session(hello))
    }

    /// Returns the mains frequency that the device's notch filter removes, Hz.
    pub(crate) fn mains_hz(&self) -> u8 {
        self.mains_hz
    }

    /// Returns the length of the device's hops; `None` if unknown or not a whole number of samples.
    pub(crate) fn hop(&self) -> Option<Hop> {
        self.hop
    }

    /// Returns the bytes of the introduction's frames, in the order in which a device sends them.
    pub(crate) fn payloads(&self) -> Vec<Vec<u8>> {
        let frames = [&self.hello, &self.substitutes, &self.capabilities, &self.converters];
        frames.into_iter().flatten().cloned().collect()
    }
}

/// The commands of the recorded host so far, by sequence number: for a `Start` the streams that it
/// asks for, for every other command `None`.
#[derive(Debug, Default)]
pub(crate) struct RecordedStarts(HashMap<u32, Option<Streams>>);

impl RecordedStarts {
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Notes the command in `payload`, a frame to the device. Returns whether it is a `Start`.
    pub(crate) fn note(&mut self, mut payload: &[u8]) -> bool {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        if let Some(Ok(frame)) = decoder.next::<ToDevice>(&mut payload) {
            let streams = match frame.message {
                ToDevice::Start(start) => Some(start.streams),
                _ => None,
            };
            self.0.insert(frame.header.seq, streams);
            return streams.is_some();
        }
        false
    }

    /// Returns the streams of the `Start` that `payload`, the bytes of a frame from the device,
    /// acknowledges; `None` if it acknowledges no `Start`.
    pub(crate) fn acknowledged_by(&self, mut payload: &[u8]) -> Option<Streams> {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        match decoder.next::<ToHost>(&mut payload)?.ok()?.message {
            ToHost::Ack(Ack { of, result: AckResult::Done }) => self.0.get(&of).copied().flatten(),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use link::{Encoder, Hello, MAX_FRAME, ResetCause, Substitutes, ToHost};

    use super::Introduction;

    fn frame(message: &ToHost) -> Vec<u8> {
        let mut buffer = [0; MAX_FRAME];
        let frame = Encoder::default().encode(0, message, &mut buffer);
        frame.unwrap().to_vec()
    }

    #[test]
    fn another_session_starts_without_the_frames_of_the_last_one() {
        let hello = |session_id| {
            frame(&ToHost::Hello(Hello {
                firmware: "test",
                board: "board",
                chip_uid: [7; 12],
                model_id: [1; 8],
                session_id,
                reset_cause: ResetCause::PowerOn,
                fault: "",
            }))
        };
        let substitutes = frame(&ToHost::Substitutes(Substitutes { interpolated: 1, zero: 0 }));
        let mut introduction = Introduction::default();
        let mut payloads = Vec::new();
        for payload in [&hello(1), &substitutes, &hello(1), &hello(2)] {
            introduction.note(payload);
            payloads.push(introduction.payloads());
        }
        assert_eq!(payloads[2], [hello(1), substitutes]);
        assert_eq!(payloads[3], [hello(2)]);
    }
}
