//! Serde adapter that writes a byte slice in one piece.

use serde::ser::Serializer;

/// Writes a byte slice: varint length, then the bytes. For `#[serde(serialize_with = "..")]`.
///
/// Serde's derive produces the same bytes for a `&[u8]`, but with one call per byte.
pub(crate) fn serialize<S: Serializer>(bytes: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}
