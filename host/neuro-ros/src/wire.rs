//! The ROS 1 serialisation: fields in order, little-endian. Strings and arrays are preceded by
//! their length as u32.

use thiserror::Error;

/// Why bytes could not be decoded as a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum WireError {
    /// A field extends beyond the end of the bytes; holds the number of bytes that are missing from
    /// the field or from the announced elements.
    #[error(
        "the message ends {0} bytes too early; sender and receiver disagree about its \
         definition (compare `rosmsg md5`), or it was cut"
    )]
    Truncated(usize),
    /// This number of bytes follows the last field.
    #[error(
        "{0} bytes follow the last field; sender and receiver disagree about the definition \
         (compare `rosmsg md5`)"
    )]
    Trailing(usize),
}

/// A value with a ROS 1 serialisation.
pub trait Wire: Sized {
    /// Smallest encoded size, bytes. [`Wire::read`] refuses an array whose elements, at this size,
    /// do not fit in the remaining bytes.
    const MIN_BYTES: usize;

    /// Appends the encoded value to `out`.
    fn write(&self, out: &mut Vec<u8>);

    /// Decodes a value from the front of `reader`.
    ///
    /// # Errors
    ///
    /// [`WireError::Truncated`] if bytes are missing. The length of an array is checked before
    /// memory is allocated for the elements.
    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError>;

    /// Encodes the value as the body of a message.
    fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.write(&mut out);
        out
    }

    /// Decodes the body of a message.
    ///
    /// # Errors
    ///
    /// [`WireError`] if the body is shorter or longer than the value.
    fn from_bytes(bytes: &[u8]) -> Result<Self, WireError> {
        let mut reader = Reader { rest: bytes };
        let value = Self::read(&mut reader)?;
        match reader.rest.len() {
            0 => Ok(value),
            count => Err(WireError::Trailing(count)),
        }
    }
}

/// The bytes of a message that have not been decoded yet.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn read_bytes(&mut self, count: usize) -> Result<&[u8], WireError> {
        let missing = WireError::Truncated(count.saturating_sub(self.rest.len()));
        self.rest.split_off(..count).ok_or(missing)
    }

    /// Reads the length of an array or string whose elements have at least `element_bytes` each.
    /// Checks that the remaining bytes can hold the elements.
    fn read_length(&mut self, element_bytes: usize) -> Result<usize, WireError> {
        let count = u32::read(self)? as usize;
        let bytes = count.saturating_mul(element_bytes);
        match bytes.checked_sub(self.rest.len()) {
            None | Some(0) => Ok(count),
            Some(missing) => Err(WireError::Truncated(missing)),
        }
    }
}

/// Appends the length of an array or string. TCPROS cannot transmit messages beyond 4 GiB, so a
/// length that does not fit in u32 is a defect of the caller. Such a length is written as 2^32 - 1,
/// and the receiver refuses the message.
fn write_length(count: usize, out: &mut Vec<u8>) {
    debug_assert!(u32::try_from(count).is_ok(), "an array of {count} elements");
    u32::try_from(count).unwrap_or(u32::MAX).write(out);
}

macro_rules! impl_wire_for_numbers {
    ($($type:ty),*) => {$(
        impl Wire for $type {
            const MIN_BYTES: usize = size_of::<$type>();

            fn write(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
                let mut bytes = [0; size_of::<$type>()];
                bytes.copy_from_slice(reader.read_bytes(size_of::<$type>())?);
                Ok(<$type>::from_le_bytes(bytes))
            }
        }
    )*};
}
impl_wire_for_numbers!(u8, i8, u16, u32, i32, f32, f64);

impl Wire for bool {
    const MIN_BYTES: usize = 1;

    fn write(&self, out: &mut Vec<u8>) {
        u8::from(*self).write(out);
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(u8::read(reader)? != 0)
    }
}

impl Wire for String {
    const MIN_BYTES: usize = 4;

    fn write(&self, out: &mut Vec<u8>) {
        write_length(self.len(), out);
        out.extend_from_slice(self.as_bytes());
    }

    /// ROS 1 does not define the encoding of strings. Bytes that are not UTF-8 become U+FFFD.
    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let count = reader.read_length(1)?;
        Ok(String::from_utf8_lossy(reader.read_bytes(count)?).into_owned())
    }
}

impl<T: Wire> Wire for Vec<T> {
    const MIN_BYTES: usize = 4;

    fn write(&self, out: &mut Vec<u8>) {
        write_length(self.len(), out);
        out.reserve(self.len() * T::MIN_BYTES);
        for element in self {
            element.write(out);
        }
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let count = reader.read_length(T::MIN_BYTES)?;
        let mut elements = Vec::with_capacity(count);
        for _ in 0..count {
            elements.push(T::read(reader)?);
        }
        Ok(elements)
    }
}

/// Returns the smallest encoded size, bytes, of the field to which `_field` returns a reference.
pub(crate) const fn min_bytes<S, T: Wire>(_field: fn(&S) -> &T) -> usize {
    T::MIN_BYTES
}

/// Implements [`Wire`] for a struct by encoding its fields in the given order.
macro_rules! impl_wire {
    ($type:ty { $($field:ident),* }) => {
        impl $crate::wire::Wire for $type {
            const MIN_BYTES: usize = 0 $(+ $crate::wire::min_bytes::<Self, _>(|s| &s.$field))*;

            fn write(&self, out: &mut Vec<u8>) {
                $($crate::wire::Wire::write(&self.$field, out);)*
            }

            fn read(reader: &mut $crate::wire::Reader<'_>) -> Result<Self, $crate::wire::WireError> {
                Ok(Self { $($field: $crate::wire::Wire::read(reader)?),* })
            }
        }
    };
}
pub(crate) use impl_wire;
