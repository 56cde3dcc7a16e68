//! Serde adapters that write integers as bytes instead of varints.
//!
//! An array of fixed length is written as its elements in two's complement, least significant byte
//! first, without a length before them. Serde itself supports arrays of at most 32 elements only.

use core::{fmt, marker::PhantomData};

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeTuple, Serializer};

/// An integer that is written with a fixed number of bytes; postcard itself writes an `i16` as a
/// varint.
pub(crate) trait Element: Copy + Default {
    type Bytes: Serialize + for<'de> Deserialize<'de>;
    fn to_bytes(self) -> Self::Bytes;
    fn from_bytes(bytes: Self::Bytes) -> Self;
}

impl Element for i8 {
    type Bytes = i8;

    fn to_bytes(self) -> i8 {
        self
    }

    fn from_bytes(bytes: i8) -> i8 {
        bytes
    }
}

impl Element for i16 {
    type Bytes = [u8; 2];

    fn to_bytes(self) -> [u8; 2] {
        self.to_le_bytes()
    }

    fn from_bytes(bytes: [u8; 2]) -> i16 {
        i16::from_le_bytes(bytes)
    }
}

/// Writes an array, for `#[serde(with = "packed")]`.
pub(crate) fn serialize<S: Serializer, E: Element, const N: usize>(
    values: &[E; N],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut tuple = serializer.serialize_tuple(N)?;
    for value in values {
        tuple.serialize_element(&value.to_bytes())?;
    }
    tuple.end()
}

/// Reads an array that [`serialize`] wrote.
pub(crate) fn deserialize<'de, D: Deserializer<'de>, E: Element, const N: usize>(
    deserializer: D,
) -> Result<[E; N], D::Error> {
    deserializer.deserialize_tuple(N, ArrayVisitor(PhantomData))
}

/// Writes a byte slice in one piece: varint length, then the bytes.
///
/// Serde's derive produces the same bytes for a `&[u8]`, but with one call per byte.
pub(crate) fn serialize_bytes<S: Serializer>(
    bytes: &&[u8],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}

struct ArrayVisitor<E, const N: usize>(PhantomData<E>);

impl<'de, E: Element, const N: usize> Visitor<'de> for ArrayVisitor<E, N> {
    type Value = [E; N];

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{N} integers")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<[E; N], A::Error> {
        let mut values = [E::default(); N];
        for (index, value) in values.iter_mut().enumerate() {
            let bytes = sequence
                .next_element()?
                .ok_or_else(|| Error::invalid_length(index, &self))?;
            *value = E::from_bytes(bytes);
        }
        Ok(values)
    }
}
