//! The stream that `/neurodata_reconstructed` is decoded from.

use link::Streams;

/// The stream that `/neurodata_reconstructed` is decoded from, and whether the bridge's model decodes it.
///
/// It follows from the streams that the device is asked for, and so changes when the device refuses some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Decoding {
    pub(crate) stream: DecodedStream,
    /// Whether the bridge's model is the device's, and decodes the stream.
    pub(crate) is_possible: bool,
}

/// A stream that yields electrode signals when it is decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DecodedStream {
    /// Codes of the network.
    Codes,
    /// Packed blocks, also where the device sends codes with them.
    Packed,
}

impl DecodedStream {
    /// Returns the stream that is decoded of those that a device is asked for.
    pub(crate) fn of(asked: Streams) -> DecodedStream {
        if asked.contains(Streams::PACKED) {
            DecodedStream::Packed
        } else {
            DecodedStream::Codes
        }
    }
}

impl Decoding {
    /// Returns whether `stream` is decoded.
    pub(crate) fn decodes(self, stream: DecodedStream) -> bool {
        self.is_possible && self.stream == stream
    }
}
