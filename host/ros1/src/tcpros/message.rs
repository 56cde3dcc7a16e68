//! TCPROS messages on the wire: a length (u32, little-endian), then a body of that many bytes.

use std::io::{self, IoSlice};

use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};

/// Longest accepted message body, bytes. A larger announced length is treated as a corrupt stream.
pub const MAX_MESSAGE: usize = 256 * 1024 * 1024;
/// Largest buffer allocated before the first byte of a message body has arrived, bytes.
const FIRST_ALLOCATION: usize = 64 * 1024;

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
pub(super) async fn read_exactly<S: AsyncRead + Unpin>(
    stream: &mut S,
    size: usize,
) -> io::Result<Vec<u8>> {
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
