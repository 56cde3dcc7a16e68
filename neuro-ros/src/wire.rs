//! The ROS 1 wire form: little-endian, in field order, lengths as u32 before texts and arrays.

use thiserror::Error;

/// Why bytes are not the message they should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum WireError {
    /// A field reaches beyond the end.
    #[error(
        "the message ends {missing} bytes too early; sender and receiver disagree about its \
         definition (compare `rosmsg md5`), or it was cut"
    )]
    Truncated {
        /// Bytes (of the field, or of the announced elements) that are not there.
        missing: usize,
    },
    /// Bytes follow the last field.
    #[error(
        "{count} bytes follow the last field; sender and receiver disagree about the definition \
         (compare `rosmsg md5`)"
    )]
    Trailing {
        /// How many.
        count: usize,
    },
}

/// A value with a ROS 1 wire form.
pub trait Wire: Sized {
    /// Fewest bytes that a value takes; bounds what an announced array length may claim.
    const MIN_BYTES: usize;

    /// Append the value to `out`.
    fn write(&self, out: &mut Vec<u8>);

    /// Read the value from the front of `reader`.
    ///
    /// # Errors
    ///
    /// [`WireError::Truncated`]; nothing is allocated for elements that cannot be there.
    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError>;

    /// The value as the body of a message.
    fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.write(&mut out);
        out
    }

    /// The value that the body of a message holds.
    ///
    /// # Errors
    ///
    /// [`WireError`] if the body is shorter or longer than the value.
    fn from_bytes(bytes: &[u8]) -> Result<Self, WireError> {
        let mut reader = Reader { rest: bytes };
        let value = Self::read(&mut reader)?;
        match reader.rest.len() {
            0 => Ok(value),
            count => Err(WireError::Trailing { count }),
        }
    }
}

/// Bytes that have not been read yet.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn take(&mut self, count: usize) -> Result<&[u8], WireError> {
        match self.rest.split_at_checked(count) {
            Some((front, rest)) => {
                self.rest = rest;
                Ok(front)
            }
            None => Err(WireError::Truncated {
                missing: count - self.rest.len(),
            }),
        }
    }

    /// An announced number of elements, each of at least `element_bytes`, that can be there.
    fn length(&mut self, element_bytes: usize) -> Result<usize, WireError> {
        let count = u32::read(self)? as usize;
        let bytes = count.saturating_mul(element_bytes);
        match bytes.checked_sub(self.rest.len()) {
            None | Some(0) => Ok(count),
            Some(missing) => Err(WireError::Truncated { missing }),
        }
    }
}

/// Append a length. A message beyond 4 GiB cannot be framed by TCPROS at all, so a length that
/// does not fit is a defect of the caller; it is written saturated and the reader refuses it.
fn write_length(count: usize, out: &mut Vec<u8>) {
    debug_assert!(u32::try_from(count).is_ok(), "an array of {count} elements");
    u32::try_from(count).unwrap_or(u32::MAX).write(out);
}

macro_rules! number {
    ($($type:ty),*) => {$(
        impl Wire for $type {
            const MIN_BYTES: usize = size_of::<$type>();

            fn write(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
                let mut bytes = [0; size_of::<$type>()];
                bytes.copy_from_slice(reader.take(size_of::<$type>())?);
                Ok(<$type>::from_le_bytes(bytes))
            }
        }
    )*};
}
number!(u8, i8, u16, u32, i32, f32, f64);

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

    /// ROS 1 texts are bytes of no named encoding; those that are not UTF-8 come out with U+FFFD.
    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let count = reader.length(1)?;
        Ok(String::from_utf8_lossy(reader.take(count)?).into_owned())
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
        let count = reader.length(T::MIN_BYTES)?;
        let mut elements = Vec::with_capacity(count);
        for _ in 0..count {
            elements.push(T::read(reader)?);
        }
        Ok(elements)
    }
}

/// Implements [`Wire`] for a struct: its fields one after another.
macro_rules! fields {
    ($type:ty { $($field:ident: $kind:ty),* $(,)? }) => {
        impl $crate::Wire for $type {
            const MIN_BYTES: usize = 0 $(+ <$kind as $crate::Wire>::MIN_BYTES)*;

            fn write(&self, out: &mut Vec<u8>) {
                $($crate::Wire::write(&self.$field, out);)*
            }

            fn read(reader: &mut $crate::Reader<'_>) -> Result<Self, $crate::WireError> {
                Ok(Self { $($field: <$kind as $crate::Wire>::read(reader)?),* })
            }
        }
    };
}
pub(crate) use fields;
