//! Bytes for serde at once, which would go through a slice one by one.
//!
//! On the wire a varint length and the bytes: what a list of bytes is anyway.

use serde::Serializer;

pub(crate) fn serialize<S: Serializer>(bytes: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}
