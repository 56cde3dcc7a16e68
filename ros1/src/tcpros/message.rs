//! A length (u32, little-endian) and as many bytes.

use std::io::{self, IoSlice};

use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};

/// Longest message, bytes. A length beyond it is noise, not a message.
pub const MAX_MESSAGE: usize = 256 * 1024 * 1024;
/// Memory taken before the first byte of a block has come.
const FIRST_ALLOCATION: usize = 64 * 1024;

/// Reads a length and its bytes.
pub(crate) async fn read_block<S: AsyncRead + Unpin>(stream: &mut S) -> io::Result<Vec<u8>> {
    let length = stream.read_u32_le().await?;
    read_body(stream, length).await
}

/// Reads the bytes that follow a length.
pub(crate) async fn read_body<S: AsyncRead + Unpin>(
    stream: &mut S,
    length: u32,
) -> io::Result<Vec<u8>> {
    match usize::try_from(length) {
        Ok(size) if size <= MAX_MESSAGE => read_exactly(stream, size).await,
        _ => Err(io::Error::new(
            io::ErrorKind::InvalidData,
            format!("a message of {length} bytes is announced; at most {MAX_MESSAGE} are taken"),
        )),
    }
}

/// Reads `size` bytes. Memory grows with what arrives, never with what is promised.
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

/// Writes the length and the bytes, in one system call where the socket has room.
pub(crate) async fn write_block<S: AsyncWrite + Unpin>(
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
