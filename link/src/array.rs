//! Byte arrays of fixed length for serde, which stops at 32 elements by itself.
//!
//! On the wire `N` bytes in two's complement and no length before them.

use core::fmt;

use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{SerializeTuple, Serializer};

pub(crate) fn serialize<S: Serializer, const N: usize>(
    values: &[i8; N],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut tuple = serializer.serialize_tuple(N)?;
    for value in values {
        tuple.serialize_element(value)?;
    }
    tuple.end()
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>, const N: usize>(
    deserializer: D,
) -> Result<[i8; N], D::Error> {
    deserializer.deserialize_tuple(N, ArrayVisitor)
}

struct ArrayVisitor<const N: usize>;

impl<'de, const N: usize> Visitor<'de> for ArrayVisitor<N> {
    type Value = [i8; N];

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{N} signed bytes")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<[i8; N], A::Error> {
        let mut values = [0; N];
        for (index, value) in values.iter_mut().enumerate() {
            *value = sequence
                .next_element()?
                .ok_or_else(|| Error::invalid_length(index, &self))?;
        }
        Ok(values)
    }
}
