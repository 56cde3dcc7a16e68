//! Reads the body of an HTTP request or response, with or without chunked transfer encoding.

use tokio::io::{AsyncBufRead, AsyncRead, AsyncReadExt as _};

use super::head::{Head, HttpError, read_line};

/// Longest accepted body, bytes: enough for the parameter tree of a large robot.
const MAX_BODY: usize = 16 * 1024 * 1024;
/// Longest accepted line that announces the size of a chunk, bytes.
const MAX_CHUNK_LINE: usize = 256;
/// Longest accepted trailer (fields after the last chunk), bytes.
const MAX_TRAILER: usize = 8 * 1024;

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
        let line = read_line(stream, &mut left)
            .await?
            .ok_or(HttpError::Truncated)?;
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
