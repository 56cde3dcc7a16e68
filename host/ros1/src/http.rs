//! The subset of HTTP/1.1 that XML-RPC peers use: `Content-Length`, chunked bodies and keep-alive
//! connections. This module limits the length of all that it reads; the callers limit the time.

use std::io;

use tokio::io::{AsyncBufRead, AsyncBufReadExt as _, AsyncRead, AsyncReadExt as _};

/// Longest accepted head (first line and fields), bytes. XML-RPC peers send less than 300 bytes.
const MAX_HEAD: usize = 32 * 1024;
/// Longest accepted body, bytes: enough for the parameter tree of a large robot.
const MAX_BODY: usize = 16 * 1024 * 1024;
/// Longest accepted line that announces the size of a chunk, bytes.
const MAX_CHUNK_LINE: usize = 256;
/// Longest accepted trailer (fields after the last chunk), bytes.
const MAX_TRAILER: usize = 8 * 1024;

/// Why an HTTP message could not be read.
#[derive(Debug, thiserror::Error)]
pub enum HttpError {
    /// Reading from or writing to the connection failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The connection ended inside a message.
    #[error("the connection ended inside the HTTP message")]
    Truncated,
    /// The head is longer than 32 KiB. Also returned for a chunk-size line longer than 256 bytes
    /// and a trailer longer than 8 KiB.
    #[error("the HTTP head is longer than {MAX_HEAD} bytes")]
    HeadTooLong,
    /// The body is longer than the limit; holds the limit in bytes.
    #[error("the HTTP body is longer than {0} bytes")]
    BodyTooLong(usize),
    /// A header field, a length or a chunk size has the wrong syntax; holds the line.
    #[error("the HTTP line '{}' is malformed", .0.escape_debug())]
    Malformed(String),
}

/// The parts of an HTTP head that determine how to read the body and when to close the connection.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Head {
    /// Request line (`POST / HTTP/1.1`) or status line (`HTTP/1.1 200 OK`).
    pub(crate) first_line: String,
    /// Length of the body, bytes; `None` without a `Content-Length` field.
    pub(crate) content_length: Option<usize>,
    /// The body has the chunked transfer encoding.
    pub(crate) chunked: bool,
    /// The sender closes the connection after this message.
    pub(crate) close: bool,
    /// The client waits for `100 Continue` before it sends the body.
    pub(crate) expects_continue: bool,
}

/// Reads the head of one message. Returns `None` if the connection ends before the head's first
/// byte.
pub(crate) async fn read_head<S: AsyncBufRead + Unpin>(
    stream: &mut S,
) -> Result<Option<Head>, HttpError> {
    let mut left = MAX_HEAD;
    let first_line = loop {
        match read_line(stream, &mut left).await? {
            None => return Ok(None),
            // RFC 9112, section 2.2: skip empty lines before the first line.
            Some(line) if line.is_empty() => {}
            Some(line) => break line,
        }
    };
    let mut head = Head {
        close: first_line.contains("HTTP/1.0"),
        first_line,
        content_length: None,
        chunked: false,
        expects_continue: false,
    };
    loop {
        let line = read_line(stream, &mut left).await?.ok_or(HttpError::Truncated)?;
        if line.is_empty() {
            return Ok(Some(head));
        }
        let Some((name, value)) = line.split_once(':') else {
            return Err(HttpError::Malformed(line));
        };
        let value = value.trim();
        match name.to_ascii_lowercase().as_str() {
            "content-length" => match value.parse() {
                Ok(length) => head.content_length = Some(length),
                Err(_) => return Err(HttpError::Malformed(line)),
            },
            "transfer-encoding" => head.chunked = value.to_ascii_lowercase().contains("chunked"),
            "connection" if value.eq_ignore_ascii_case("close") => head.close = true,
            "connection" if value.eq_ignore_ascii_case("keep-alive") => head.close = false,
            "expect" => head.expects_continue = value.eq_ignore_ascii_case("100-continue"),
            _ => {}
        }
    }
}

/// Reads one line and strips its line end; returns `None` at the end of the stream. Subtracts the
/// number of bytes read from `left`, the number of bytes that may still be read.
async fn read_line<S: AsyncBufRead + Unpin>(
    stream: &mut S,
    left: &mut usize,
) -> Result<Option<String>, HttpError> {
    let mut line = Vec::new();
    let limit = u64::try_from(*left).unwrap_or(u64::MAX);
    let count = (&mut *stream).take(limit).read_until(b'\n', &mut line).await?;
    *left -= count;
    let text = match line.strip_suffix(b"\n") {
        Some(text) => text.strip_suffix(b"\r").unwrap_or(text),
        None if *left == 0 => return Err(HttpError::HeadTooLong),
        None if line.is_empty() => return Ok(None),
        None => return Err(HttpError::Truncated),
    };
    Ok(Some(String::from_utf8_lossy(text).into_owned()))
}

/// Reads the body that follows `head`. Allocates memory as bytes arrive, not for the announced
/// length, so a peer cannot exhaust memory by announcing a huge body.
pub(crate) async fn read_body<S: AsyncBufRead + Unpin>(
    stream: &mut S,
    head: &Head,
) -> Result<Vec<u8>, HttpError> {
    let mut body = Vec::new();
    if head.chunked {
        read_chunks(stream, &mut body).await?;
    } else if let Some(length) = head.content_length {
        append(stream, &mut body, length).await?;
    } else if head.first_line.starts_with("HTTP/") {
        // A response without `Content-Length` or chunks ends when the peer closes the connection.
        let limit = u64::try_from(MAX_BODY + 1).unwrap_or(u64::MAX);
        stream.take(limit).read_to_end(&mut body).await?;
        if body.len() > MAX_BODY {
            return Err(HttpError::BodyTooLong(MAX_BODY));
        }
    }
    Ok(body)
}

async fn read_chunks<S: AsyncBufRead + Unpin>(
    stream: &mut S,
    body: &mut Vec<u8>,
) -> Result<(), HttpError> {
    loop {
        let mut left = MAX_CHUNK_LINE;
        let line = read_line(stream, &mut left).await?.ok_or(HttpError::Truncated)?;
        let size = line.split(';').next().unwrap_or_default().trim();
        let Ok(size) = usize::from_str_radix(size, 16) else {
            return Err(HttpError::Malformed(line));
        };
        if size == 0 {
            let mut left = MAX_TRAILER;
            while let Some(line) = read_line(stream, &mut left).await? {
                if line.is_empty() {
                    break;
                }
            }
            return Ok(());
        }
        append(stream, body, size).await?;
        let mut left = 2;
        match read_line(stream, &mut left).await? {
            Some(line) if line.is_empty() => {}
            other => return Err(HttpError::Malformed(other.unwrap_or_default())),
        }
    }
}

async fn append<S: AsyncRead + Unpin>(
    stream: &mut S,
    body: &mut Vec<u8>,
    length: usize,
) -> Result<(), HttpError> {
    if length > MAX_BODY - body.len() {
        return Err(HttpError::BodyTooLong(MAX_BODY));
    }
    let wanted = u64::try_from(length).unwrap_or(u64::MAX);
    let count = (&mut *stream).take(wanted).read_to_end(body).await?;
    if count < length {
        return Err(HttpError::Truncated);
    }
    Ok(())
}
