//! Upload of a model: its announcement, its parts, and how much of it the device has.

use serde::{Deserialize, Serialize};

/// Largest number of bytes of a [`ModelChunk`].
pub const MAX_CHUNK_BYTES: usize = 1024;

/// Arguments of `ModelBegin`, which announces a model. Sending the same announcement again, also
/// after a reconnection, continues the upload where it stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelBegin {
    /// Length of the model in the layout of `docs/wire-format.md`, bytes; a device accepts only the
    /// length of its own packed model, alone or with a linear code.
    pub bytes: u32,
    /// [`model_crc`] of these bytes.
    pub crc: u32,
    /// Id of the model: the first 8 bytes of the SHA-256 over its files. Serde skips them, because
    /// the frame carries them after the message's fields: as an array among the fields, it would
    /// cost a device 400 bytes of code.
    #[serde(skip)]
    pub id: [u8; 8],
}

/// A part of the announced model: argument of `ModelChunk`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelChunk<'a> {
    /// Offset of the chunk's first byte in the model; at most the number of bytes received so far.
    pub offset: u32,
    /// 1 to [`MAX_CHUNK_BYTES`] bytes of the model. Serde skips them, because the frame carries
    /// them after the message's fields.
    #[serde(skip)]
    pub bytes: &'a [u8],
}

/// How much of the announced model a device has; sent before the `Ack` of `ModelBegin`,
/// `ModelChunk` and `ModelEnd`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelReceived {
    /// [`ModelBegin::crc`] of the announced model; 0 if none is announced.
    pub crc: u32,
    /// Number of leading bytes of the model that the device has: the offset of the next chunk.
    pub bytes: u32,
}

/// Returns the CRC-32C of a model's bytes, for [`ModelBegin::crc`].
pub fn model_crc(model: &[u8]) -> u32 {
    crate::frame::CRC.checksum(model)
}
