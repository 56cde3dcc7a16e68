//! TCPROS: the connection header, the messages that follow it, and the types that both sides
//! compare.
//!
//! A header consists of its total length and of fields `name=value`, each preceded by its length. A
//! message consists of a length and a body of that many bytes. All lengths are u32, little-endian.

use std::{
    io::{self, IoSlice},
    time::Duration,
};

use socket2::{SockRef, TcpKeepalive};
use tokio::{
    io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _},
    net::TcpStream,
    time::timeout,
};

/// Longest accepted header, bytes. The largest field in practice is a message definition with all
/// embedded types, less than 100 KiB.
pub const MAX_HEADER: usize = 1024 * 1024;
/// Longest accepted message body, bytes. A larger announced length is treated as a corrupt stream.
pub const MAX_MESSAGE: usize = 256 * 1024 * 1024;
/// Largest buffer allocated before the first byte of a message body has arrived, bytes.
const FIRST_ALLOCATION: usize = 64 * 1024;
/// Time limit for opening a connection, and separately for receiving the peer's header. A service
/// client applies the limit to both steps together.
pub(crate) const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);
/// Idle time before the first TCP keepalive probe.
const KEEPALIVE_TIME: Duration = Duration::from_secs(10);
/// Time between two TCP keepalive probes.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);
/// Number of unanswered TCP keepalive probes after which the connection is closed. This happens
/// 25 s (10 s + 3 * 5 s) after the last byte from the peer.
const KEEPALIVE_PROBES: u32 = 3;

/// Type of a topic's messages. This crate treats their bodies as opaque bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageType {
    /// Package and name, such as `std_msgs/String`. `*` subscribes to any type.
    pub name: &'static str,
    /// MD5 sum of the definition as `rosmsg md5` prints it, 32 hex digits. `*` matches any sum.
    pub md5: &'static str,
    /// Full definition including all embedded types, as `gendeps --cat` prints it. Recorders store
    /// it, so that a recording can be read without the package.
    pub definition: &'static str,
}

/// Type of a service's request and response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServiceType {
    /// Package and name, such as `std_srvs/Empty`.
    pub name: &'static str,
    /// MD5 sum over request and response as `rossrv md5` prints it, 32 hex digits. `*` matches any
    /// sum.
    pub md5: &'static str,
    /// Text of the `.srv` file: request, `---`, response.
    pub definition: &'static str,
}

/// Why a connection header could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum HeaderError {
    /// The connection failed or ended before the whole header was transferred.
    #[error("the connection ended before the whole header came: {0}")]
    Io(#[from] io::Error),
    /// The peer did not send its header within 5 s.
    #[error("no header came within {} s", HANDSHAKE_TIMEOUT.as_secs())]
    Timeout,
    /// The header is longer than [`MAX_HEADER`]; holds its total length in bytes.
    #[error("the header has {0} bytes; at most {MAX_HEADER} are allowed")]
    TooLong(u32),
    /// The header ends inside a field or inside a field's four-byte length.
    #[error("the header ends inside a field")]
    Truncated,
    /// A header field has no `=`; holds the text of the field.
    #[error("the header field '{}' has no '='", .0.escape_debug())]
    NoEquals(String),
}

/// The fields that a subscriber, publisher, service client or provider sends when a connection
/// opens.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Header {
    fields: Vec<(String, String)>,
}

impl Header {
    /// Creates a header without fields.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends a field. The name must not contain `=`; the value can.
    #[must_use]
    pub fn with(mut self, name: &str, value: &str) -> Self {
        self.fields.push((name.to_owned(), value.to_owned()));
        self
    }

    /// Returns the value of the first field called `name`.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// Iterates over the names and values of all fields in wire order.
    pub fn fields(&self) -> impl Iterator<Item = (&str, &str)> {
        self.fields.iter().map(|(name, value)| (name.as_str(), value.as_str()))
    }

    /// Encodes the header for the wire, starting with its total length (u32, little-endian).
    ///
    /// # Errors
    /// [`HeaderError::TooLong`] if the header is longer than [`MAX_HEADER`].
    pub fn encode(&self) -> Result<Vec<u8>, HeaderError> {
        let mut bytes = vec![0; 4];
        for (name, value) in &self.fields {
            let length = checked_length(name.len() + 1 + value.len())?;
            bytes.extend_from_slice(&length.to_le_bytes());
            bytes.extend_from_slice(name.as_bytes());
            bytes.push(b'=');
            bytes.extend_from_slice(value.as_bytes());
        }
        let length = checked_length(bytes.len() - 4)?;
        bytes[..4].copy_from_slice(&length.to_le_bytes());
        Ok(bytes)
    }

    /// Decodes the bytes that follow the total length. Bytes that are not UTF-8 become U+FFFD,
    /// because other nodes send names in other encodings.
    ///
    /// # Errors
    /// [`HeaderError`] if the bytes are not a sequence of `name=value` fields.
    pub fn decode(mut bytes: &[u8]) -> Result<Self, HeaderError> {
        let mut fields = Vec::new();
        while !bytes.is_empty() {
            let (length, rest) = bytes.split_first_chunk::<4>().ok_or(HeaderError::Truncated)?;
            let length = usize::try_from(u32::from_le_bytes(*length)).ok();
            let field = length.and_then(|length| rest.split_at_checked(length));
            let (field, rest) = field.ok_or(HeaderError::Truncated)?;
            let text = String::from_utf8_lossy(field);
            match text.split_once('=') {
                Some((name, value)) => fields.push((name.to_owned(), value.to_owned())),
                None => return Err(HeaderError::NoEquals(text.into_owned())),
            }
            bytes = rest;
        }
        Ok(Self { fields })
    }

    /// Reads a header of at most [`MAX_HEADER`] bytes within [`HANDSHAKE_TIMEOUT`].
    pub(crate) async fn read<S: AsyncRead + Unpin>(stream: &mut S) -> Result<Self, HeaderError> {
        let bytes = async {
            let length = stream.read_u32_le().await?;
            match usize::try_from(length) {
                Ok(size) if size <= MAX_HEADER => Ok(read_exactly(stream, size).await?),
                _ => Err(HeaderError::TooLong(length)),
            }
        };
        let bytes = timeout(HANDSHAKE_TIMEOUT, bytes).await.map_err(|_| HeaderError::Timeout)??;
        Self::decode(&bytes)
    }
}

fn checked_length(length: usize) -> Result<u32, HeaderError> {
    let small = u32::try_from(length).unwrap_or(u32::MAX);
    if length > MAX_HEADER { Err(HeaderError::TooLong(small)) } else { Ok(small) }
}

/// Sends a header with an error message and closes the connection.
pub(crate) async fn refuse(mut stream: TcpStream, reason: &str) -> Result<(), HeaderError> {
    let refusal = Header::new().with("error", reason).encode()?;
    stream.write_all(&refusal).await?;
    Ok(stream.shutdown().await?)
}

/// Compares the type and MD5 sum in a peer's header with ours. Returns an error message if either
/// differs. `*` on either side matches everything.
pub(crate) fn type_mismatch(
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

/// Reads one message, length and body, and returns the body.
pub(crate) async fn read_message<S: AsyncRead + Unpin>(stream: &mut S) -> io::Result<Vec<u8>> {
    let length = stream.read_u32_le().await?;
    read_message_body(stream, length).await
}

/// Reads a message body of `length` bytes; the length itself has already been read.
pub(crate) async fn read_message_body<S: AsyncRead + Unpin>(
    stream: &mut S,
    length: u32,
) -> io::Result<Vec<u8>> {
    match usize::try_from(length) {
        Ok(size) if size <= MAX_MESSAGE => read_exactly(stream, size).await,
        _ => Err(io::Error::new(
            io::ErrorKind::InvalidData,
            format!("the message has {length} bytes; at most {MAX_MESSAGE} are allowed"),
        )),
    }
}

/// Reads exactly `size` bytes. Allocates memory as bytes arrive, not for `size` in advance.
async fn read_exactly<S: AsyncRead + Unpin>(stream: &mut S, size: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(size.min(FIRST_ALLOCATION));
    let wanted = u64::try_from(size).unwrap_or(u64::MAX);
    let count = stream.take(wanted).read_to_end(&mut bytes).await?;
    if count < size {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(bytes)
}

/// Writes one message, length and body. Needs only one system call if the socket buffer has room.
pub(crate) async fn write_message<S: AsyncWrite + Unpin>(
    stream: &mut S,
    body: &[u8],
) -> io::Result<()> {
    let length = u32::try_from(body.len()).map_err(|_| io::ErrorKind::InvalidInput)?;
    let prefix = length.to_le_bytes();
    let mut written = 0;
    while written < prefix.len() {
        let parts = [IoSlice::new(&prefix[written..]), IoSlice::new(body)];
        match stream.write_vectored(&parts).await? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            count => written += count,
        }
    }
    stream.write_all(&body[written - prefix.len()..]).await
}

/// Disables Nagle's algorithm, so that small messages are sent at once, and enables keepalive.
/// Without keepalive, a side that only receives would never detect that its peer has vanished
/// (power cut, unplugged cable).
pub(crate) fn set_options(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let keepalive = TcpKeepalive::new()
        .with_time(KEEPALIVE_TIME)
        .with_interval(KEEPALIVE_INTERVAL)
        .with_retries(KEEPALIVE_PROBES);
    SockRef::from(stream).set_tcp_keepalive(&keepalive)
}
