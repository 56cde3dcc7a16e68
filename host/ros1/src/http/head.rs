//! Reads the head of an HTTP request or response: its first line and its fields.

use std::io;

use tokio::io::{AsyncBufRead, AsyncBufReadExt as _, AsyncReadExt as _};

/// Longest accepted head, bytes. XML-RPC peers in Python and C++ send less than 300 bytes.
const MAX_HEAD: usize = 32 * 1024;

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
        let line = read_line(stream, &mut left)
            .await?
            .ok_or(HttpError::Truncated)?;
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

/// Reads one line and strips its line end; returns `None` at the end of the stream. `left` is the
/// number of bytes that may still be read; it is reduced by the number of bytes read.
pub(super) async fn read_line<S: AsyncBufRead + Unpin>(
    stream: &mut S,
    left: &mut usize,
) -> Result<Option<String>, HttpError> {
    let mut line = Vec::new();
    let limit = u64::try_from(*left).unwrap_or(u64::MAX);
    let count = (&mut *stream)
        .take(limit)
        .read_until(b'\n', &mut line)
        .await?;
    if count == 0 {
        return if *left == 0 {
            Err(HttpError::HeadTooLong)
        } else {
            Ok(None)
        };
    }
    *left -= count;
    if line.last() != Some(&b'\n') {
        return Err(if *left == 0 {
            HttpError::HeadTooLong
        } else {
            HttpError::Truncated
        });
    }
    line.pop();
    if line.last() == Some(&b'\r') {
        line.pop();
    }
    Ok(Some(String::from_utf8_lossy(&line).into_owned()))
}
