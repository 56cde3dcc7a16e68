//! Asks the device to identify itself, as a state machine that performs no I/O itself.

use bridge_core::{Device, DeviceError, DeviceSummary, Identity, PendingCommand};
use link::{Decoder, Encoder, MAX_FRAME, ToDevice, ToHost};

/// What the port sent in answer to `Identify`.
#[derive(Clone, Debug)]
pub(crate) enum DeviceAnswer {
    /// The port was not opened, because of an earlier finding.
    NotAsked,
    /// The port does not open.
    NotOpen { why: String, remedy: String },
    /// The connection broke before the device introduced itself.
    Lost { why: String },
    /// Nothing.
    Silent,
    /// Bytes, and no frame among them.
    Stranger { bytes: u64 },
    /// Frames of another version of the wire format.
    OtherVersion,
    /// Frames without a `Hello`.
    NoHello,
    /// An introduction.
    Identified(Box<IdentifiedDevice>),
}

/// A device that has introduced itself.
#[derive(Clone, Debug)]
pub(crate) struct IdentifiedDevice {
    pub(crate) summary: DeviceSummary,
    pub(crate) model_id: [u8; 8],
    /// Properties of the device; `None` without `Capabilities`.
    pub(crate) device: Option<Result<Device, DeviceError>>,
}

/// Sends `Identify` until the device has introduced itself.
#[derive(Debug)]
pub(crate) struct Probe {
    decoder: Decoder<MAX_FRAME>,
    encoder: Encoder,
    pending: Option<PendingCommand>,
    identity: Option<Identity>,
    device: Option<Result<Device, DeviceError>>,
}

impl Probe {
    pub(crate) fn new() -> Probe {
        Probe {
            decoder: Decoder::new(),
            encoder: Encoder::default(),
            pending: None,
            identity: None,
            device: None,
        }
    }

    /// Returns the bytes to send now.
    pub(crate) fn outgoing(&mut self, now_us: i64) -> Vec<u8> {
        if self
            .pending
            .is_some_and(|pending| !pending.retry_is_due(now_us))
        {
            return Vec::new();
        }
        let seq = self.encoder.next_seq();
        self.pending = Some(PendingCommand::new(ToDevice::Identify, seq, now_us));
        let mut buffer = [0; MAX_FRAME];
        let frame = self.encoder.encode(0, &ToDevice::Identify, &mut buffer);
        frame.map(<[u8]>::to_vec).unwrap_or_default()
    }

    /// Handles bytes from the device. Returns whether the introduction is complete.
    pub(crate) fn receive(&mut self, mut bytes: &[u8]) -> bool {
        while let Some(frame) = self.decoder.next::<ToHost>(&mut bytes) {
            let Ok(frame) = frame else { continue };
            match &frame.message {
                ToHost::Hello(hello) => self.identity = Some(Identity::new(hello)),
                ToHost::Capabilities(capabilities) => {
                    if let Some(identity) = &self.identity {
                        self.device = Some(Device::new(&identity.as_hello(), capabilities));
                    }
                }
                _ => {}
            }
        }
        self.device.is_some()
    }

    /// Returns what was received so far.
    pub(crate) fn answer(self) -> DeviceAnswer {
        let counters = self.decoder.counters();
        match self.identity {
            Some(identity) => {
                let hello = identity.as_hello();
                DeviceAnswer::Identified(Box::new(IdentifiedDevice {
                    summary: DeviceSummary::new(&hello),
                    model_id: hello.model_id,
                    device: self.device,
                }))
            }
            None if counters.bytes == 0 => DeviceAnswer::Silent,
            None if counters.frames > 0 => DeviceAnswer::NoHello,
            None if counters.version > 0 => DeviceAnswer::OtherVersion,
            None => DeviceAnswer::Stranger {
                bytes: counters.bytes,
            },
        }
    }
}
