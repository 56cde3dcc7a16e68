//! The subset of HTTP/1.1 that the page needs: requests without a body, one per connection.

use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt as _};
use tokio::time::timeout;

/// Longest accepted head of a request, bytes. Browsers send about 600 bytes; 64 labels add 400.
const MAX_HEAD: usize = 8 * 1024;
/// Longest time in which the head of a request must arrive.
const HEAD_TIMEOUT: Duration = Duration::from_secs(5);

/// Status line of a refusal.
pub(crate) type Refusal = &'static str;

pub(crate) const BAD_REQUEST: Refusal = "400 Bad Request";
pub(crate) const UNAUTHORIZED: Refusal = "401 Unauthorized";
pub(crate) const FORBIDDEN: Refusal = "403 Forbidden";
pub(crate) const NOT_FOUND: Refusal = "404 Not Found";
pub(crate) const METHOD_NOT_ALLOWED: Refusal = "405 Method Not Allowed";
pub(crate) const CONTENT_TOO_LARGE: Refusal = "413 Content Too Large";
pub(crate) const HEAD_TOO_LARGE: Refusal = "431 Request Header Fields Too Large";
pub(crate) const UNAVAILABLE: Refusal = "503 Service Unavailable";

/// The head of a request.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) method: String,
    /// Path and query, as sent.
    pub(crate) target: String,
    pub(crate) host: String,
    pub(crate) origin: Option<String>,
    /// Whether a page of another site has made the browser send the request, by the field
    /// `Sec-Fetch-Site`, which only browsers set.
    pub(crate) is_foreign: bool,
    /// Token of the field `Authorization: Bearer`.
    pub(crate) token: Option<String>,
    /// Whether a body follows.
    pub(crate) has_body: bool,
}

/// Reads the head of a request. Returns `None` if none arrives in time.
pub(crate) async fn read(
    stream: &mut (impl AsyncRead + Unpin),
) -> Option<Result<Request, Refusal>> {
    let head = timeout(HEAD_TIMEOUT, read_head(stream)).await.ok()??;
    Some(head.and_then(|head| parse(&head)))
}

async fn read_head(stream: &mut (impl AsyncRead + Unpin)) -> Option<Result<String, Refusal>> {
    let mut head = Vec::with_capacity(1024);
    loop {
        if let Some(end) = head.windows(4).position(|four| four == b"\r\n\r\n") {
            head.truncate(end);
            return Some(String::from_utf8(head).map_err(|_| BAD_REQUEST));
        }
        if head.len() >= MAX_HEAD {
            return Some(Err(HEAD_TOO_LARGE));
        }
        let limit = (MAX_HEAD - head.len()) as u64;
        if (&mut *stream).take(limit).read_buf(&mut head).await.ok()? == 0 {
            return None;
        }
    }
}

fn parse(head: &str) -> Result<Request, Refusal> {
    let mut lines = head.split("\r\n");
    let mut first = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(target), Some("HTTP/1.1"), None) =
        (first.next(), first.next(), first.next(), first.next())
    else {
        return Err(BAD_REQUEST);
    };
    let mut request = Request {
        method: method.to_owned(),
        target: target.to_owned(),
        ..Request::default()
    };
    let mut hosts = 0;
    for line in lines {
        let (name, value) = line.split_once(':').ok_or(BAD_REQUEST)?;
        let value = value.trim();
        match name.to_ascii_lowercase().as_str() {
            "host" => {
                hosts += 1;
                request.host = value.to_ascii_lowercase();
            }
            "origin" => request.origin = Some(value.to_ascii_lowercase()),
            "sec-fetch-site" => request.is_foreign = !["same-origin", "none"].contains(&value),
            "authorization" => request.token = value.strip_prefix("Bearer ").map(str::to_owned),
            "content-length" => request.has_body |= value != "0",
            "transfer-encoding" => request.has_body = true,
            _ => {}
        }
    }
    if hosts == 1 {
        Ok(request)
    } else {
        Err(BAD_REQUEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_of_a_head_are_read() {
        let head = "POST /stop HTTP/1.1\r\nHOST: LocalHost:1\r\nOrigin: http://a\r\nContent-Length: 0\r\n\
                    Authorization: Bearer abc";
        let request = parse(head).expect("a request");
        let expected = Request {
            method: "POST".to_owned(),
            target: "/stop".to_owned(),
            host: "localhost:1".to_owned(),
            origin: Some("http://a".to_owned()),
            is_foreign: false,
            token: Some("abc".to_owned()),
            has_body: false,
        };
        assert_eq!(request, expected);
        let chunked =
            "POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\nContent-Length: 0";
        assert!(parse(chunked).expect("a request").has_body);
    }

    #[test]
    fn malformed_heads_are_refused() {
        for head in [
            "",
            "GET /",
            "GET / HTTP/1.0\r\nHost: a",
            "GET / x HTTP/1.1\r\nHost: a",
            "GET / HTTP/1.1",
            "GET / HTTP/1.1\r\nHost: a\r\nHost: b",
            "GET / HTTP/1.1\r\nHost: a\r\nfield",
        ] {
            assert_eq!(parse(head), Err(BAD_REQUEST), "{head}");
        }
    }
}
