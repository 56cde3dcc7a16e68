//! Upload of a model to the device, between `Stop` and `Start`.

use std::sync::Arc;

use link::{
    AckResult, MAX_CHUNK_BYTES, ModelBegin, ModelChunk, ModelReceived, ToDevice, model_crc,
};

/// Number of uploads that a device may reject as unsound before the bridge gives up.
const ATTEMPTS: u32 = 3;

/// A model that the device is to use in place of its built-in model.
#[derive(Clone, Debug)]
pub struct Upload {
    begin: ModelBegin,
    bytes: Arc<[u8]>,
}

impl Upload {
    /// Creates an upload of `bytes`, the packed code of the model with this id, in the layout of
    /// `docs/wire-format.md`.
    ///
    /// # Panics
    /// If the model has more than 2^32 bytes.
    pub fn new(id: [u8; 8], bytes: Arc<[u8]>) -> Upload {
        let begin = ModelBegin {
            id,
            bytes: u32::try_from(bytes.len()).expect("a model has some hundred kilobytes"),
            crc: model_crc(&bytes),
        };
        Upload { begin, bytes }
    }

    /// Returns the id that the device reports when it uses the model.
    pub(crate) fn id(&self) -> [u8; 8] {
        self.begin.id
    }
}

/// An upload under way, as far as the device has confirmed it.
#[derive(Clone, Debug)]
pub(crate) struct Uploading {
    upload: Upload,
    /// Number of bytes that the device has; `None` before it has answered the announcement.
    received: Option<u32>,
    /// Number of times that the device has found the model unsound.
    failures: u32,
}

impl Uploading {
    pub(crate) fn new(upload: Upload) -> Uploading {
        Uploading { upload, received: None, failures: 0 }
    }

    /// Returns the next command. A chunk comes without its bytes; see [`Self::with_bytes`].
    pub(crate) fn command(&self) -> ToDevice<'static> {
        match self.received {
            None => ToDevice::ModelBegin(self.upload.begin),
            Some(offset) if offset < self.upload.begin.bytes => {
                ToDevice::ModelChunk(ModelChunk { offset, bytes: &[] })
            }
            Some(_) => ToDevice::ModelEnd,
        }
    }

    /// Returns `command`, completed with bytes of the model if it is a chunk.
    pub(crate) fn with_bytes<'u>(&'u self, command: ToDevice<'u>) -> ToDevice<'u> {
        let ToDevice::ModelChunk(ModelChunk { offset, .. }) = command else {
            return command;
        };
        let rest = usize::try_from(offset).ok().and_then(|offset| self.upload.bytes.get(offset..));
        let rest = rest.unwrap_or_default();
        let bytes = &rest[..rest.len().min(MAX_CHUNK_BYTES)];
        ToDevice::ModelChunk(ModelChunk { offset, bytes })
    }

    /// Records how much of the model the device reports to have. If it reports another model or
    /// none, it has restarted or serves another program: the upload begins again.
    pub(crate) fn record(&mut self, received: ModelReceived) {
        self.received = (received.crc == self.upload.begin.crc).then_some(received.bytes);
    }

    /// Handles the device's refusal of `command`, a command of the upload. Returns whether the
    /// upload has failed for good.
    pub(crate) fn handle_refusal(&mut self, command: &ToDevice, result: AckResult) -> bool {
        match (command, result) {
            // All chunks arrived intact but are not this model: another program has sent some.
            (_, AckResult::Failed) => {
                self.received = None;
                self.failures += 1;
                self.failures >= ATTEMPTS
            }
            // The device no longer has the announcement: it restarted, or another program sent
            // another one.
            (ToDevice::ModelChunk(_) | ToDevice::ModelEnd, AckResult::BadArgument) => {
                self.received = None;
                false
            }
            _ => true,
        }
    }

    /// Returns the part of the model that the device has, percent.
    pub(crate) fn percent(&self) -> u64 {
        let received = u64::from(self.received.unwrap_or(0));
        received * 100 / u64::from(self.upload.begin.bytes.max(1))
    }
}
