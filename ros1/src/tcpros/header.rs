//! The connection header: `name=value` fields, each with its length, and the length of all.

use std::{io, time::Duration};

use tokio::{
    io::{AsyncRead, AsyncReadExt as _},
    time::timeout,
};

use super::message::read_exactly;

/// Longest header, bytes: a message definition with all its parts stays below 100 KiB.
pub const MAX_HEADER: usize = 1024 * 1024;
/// A peer must send its header within this time.
pub(crate) const HANDSHAKE_LIMIT: Duration = Duration::from_secs(5);

/// Why there is no header.
#[derive(Debug, thiserror::Error)]
pub enum HeaderError {
    /// The connection failed or ended.
    #[error("the connection ended before the whole header came: {0}")]
    Io(#[from] io::Error),
    /// The peer is silent.
    #[error("no header came within {HANDSHAKE_LIMIT:?}")]
    Timeout,
    /// A length that no header has.
    #[error("a header of {length} bytes is announced; at most {MAX_HEADER} are taken")]
    TooLong {
        /// The announced length, bytes.
        length: u32,
    },
    /// A field's length goes beyond the header.
    #[error("a field of {length} bytes is announced where {left} bytes are left")]
    FieldTooLong {
        /// The announced length, bytes.
        length: u32,
        /// What is left of the header, bytes.
        left: usize,
    },
    /// Fewer than the four bytes of a length.
    #[error("the header ends inside the length of a field")]
    Truncated,
    /// A field without `=`.
    #[error("the header field {0:?} has no '='")]
    NoEquals(String),
}

/// The fields that both sides send first.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Header {
    fields: Vec<(String, String)>,
}

impl Header {
    /// No fields yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// With one field more. A name has no `=`; a value may have.
    #[must_use]
    pub fn with(mut self, name: &str, value: &str) -> Self {
        self.fields.push((name.to_owned(), value.to_owned()));
        self
    }

    /// The value of a field.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.fields
            .iter()
            .find(|(key, _)| key == name)
            .map(|(_, value)| value.as_str())
    }

    /// The fields in their order.
    pub fn fields(&self) -> impl Iterator<Item = (&str, &str)> {
        self.fields
            .iter()
            .map(|(name, value)| (name.as_str(), value.as_str()))
    }

    /// The bytes on the wire, with the length of all in front (u32, little-endian).
    ///
    /// # Errors
    /// [`HeaderError::TooLong`] beyond [`MAX_HEADER`].
    pub fn encode(&self) -> Result<Vec<u8>, HeaderError> {
        let mut bytes = vec![0; 4];
        for (name, value) in &self.fields {
            let length = bounded(name.len() + 1 + value.len())?;
            bytes.extend_from_slice(&length.to_le_bytes());
            bytes.extend_from_slice(name.as_bytes());
            bytes.push(b'=');
            bytes.extend_from_slice(value.as_bytes());
        }
        let length = bounded(bytes.len() - 4)?;
        bytes[..4].copy_from_slice(&length.to_le_bytes());
        Ok(bytes)
    }

    /// Reads the bytes that follow the length of all. Text that is not UTF-8 is replaced by
    /// U+FFFD: other nodes send such strings.
    ///
    /// # Errors
    /// The bytes are not a sequence of `name=value` fields.
    pub fn decode(mut bytes: &[u8]) -> Result<Self, HeaderError> {
        let mut fields = Vec::new();
        while !bytes.is_empty() {
            let (length, rest) = bytes
                .split_first_chunk::<4>()
                .ok_or(HeaderError::Truncated)?;
            let length = u32::from_le_bytes(*length);
            let field = usize::try_from(length)
                .ok()
                .and_then(|length| rest.split_at_checked(length));
            let (field, rest) = field.ok_or(HeaderError::FieldTooLong {
                length,
                left: rest.len(),
            })?;
            let text = String::from_utf8_lossy(field);
            match text.split_once('=') {
                Some((name, value)) => fields.push((name.to_owned(), value.to_owned())),
                None => return Err(HeaderError::NoEquals(text.into_owned())),
            }
            bytes = rest;
        }
        Ok(Self { fields })
    }

    /// Reads a header from a connection, within the limits of length and time.
    pub(crate) async fn read<S: AsyncRead + Unpin>(stream: &mut S) -> Result<Self, HeaderError> {
        let bytes = async {
            let length = stream.read_u32_le().await?;
            match usize::try_from(length) {
                Ok(size) if size <= MAX_HEADER => Ok(read_exactly(stream, size).await?),
                _ => Err(HeaderError::TooLong { length }),
            }
        };
        let bytes = timeout(HANDSHAKE_LIMIT, bytes)
            .await
            .map_err(|_| HeaderError::Timeout)??;
        Self::decode(&bytes)
    }
}

fn bounded(length: usize) -> Result<u32, HeaderError> {
    let small = u32::try_from(length).unwrap_or(u32::MAX);
    if length > MAX_HEADER {
        Err(HeaderError::TooLong { length: small })
    } else {
        Ok(small)
    }
}

/// Where a peer's header and our type differ; `None` when they agree. `*` agrees with all.
pub(crate) fn disagreement(
    header: &Header,
    what: &str,
    our_type: &str,
    our_md5: &str,
) -> Option<String> {
    let Some(md5) = header.get("md5sum") else {
        return Some(format!("the header for {what} has no md5sum"));
    };
    let their_type = header.get("type").unwrap_or("*");
    let same = |theirs: &str, ours: &str| theirs == "*" || ours == "*" || theirs == ours;
    if same(md5, our_md5) && same(their_type, our_type) {
        return None;
    }
    Some(format!(
        "{what}: the peer has datatype/md5sum [{their_type}/{md5}], \
         we have [{our_type}/{our_md5}]; generate both from the same definition"
    ))
}
