//! The subset of HTTP/1.1 that the page needs: one request per connection, with a short body.

use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt as _};
use tokio::time::timeout;

/// Longest accepted head of a request, bytes. Browsers send about 600 bytes; the query of `/places`
/// with 64 electrode labels adds 400.
const MAX_HEAD: usize = 8 * 1024;
/// Longest accepted body of a request, bytes: a marker of 200 characters takes at most 800.
const MAX_BODY: usize = 1024;
/// Time limit for a request to arrive.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Why a request is not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Status line of the response.
    pub(crate) status: &'static str,
    /// Text of the response.
    pub(crate) why: &'static str,
}

impl Refusal {
    pub(crate) const fn new(status: &'static str) -> Refusal {
        Refusal { status, why: status }
    }
}

pub(crate) const BAD_REQUEST: Refusal = Refusal::new("400 Bad Request");
pub(crate) const UNAUTHORIZED: Refusal = Refusal::new("401 Unauthorized");
pub(crate) const FORBIDDEN: Refusal = Refusal::new("403 Forbidden");
pub(crate) const NOT_FOUND: Refusal = Refusal::new("404 Not Found");
pub(crate) const METHOD_NOT_ALLOWED: Refusal = Refusal::new("405 Method Not Allowed");
pub(crate) const CONTENT_TOO_LARGE: Refusal = Refusal::new("413 Content Too Large");
pub(crate) const HEAD_TOO_LARGE: Refusal = Refusal::new("431 Request Header Fields Too Large");
pub(crate) const UNAVAILABLE: Refusal = Refusal::new("503 Service Unavailable");

/// The parts of an HTTP request that the page needs.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// Method, such as `GET`.
    pub method: String,
    /// Path and query, as sent.
    pub target: String,
    /// Name and port by which the client addresses this server, in lower case.
    pub host: String,
    /// Field `Origin` in lower case: the site whose page caused the request.
    pub origin: Option<String>,
    /// Whether the field `Sec-Fetch-Site`, which only browsers set, says that a page of another
    /// site caused the request.
    pub is_foreign: bool,
    /// Token of the field `Authorization: Bearer`.
    pub token: Option<String>,
    /// Body, at most 1 KiB.
    pub body: Vec<u8>,
}

impl Request {
    /// Reads a request from the bytes that have arrived so far; `None` if a part is still missing.
    ///
    /// # Errors
    ///
    /// [`Refusal`] if the head is malformed, or head or body are too long. A body whose length is
    /// not stated counts as too long.
    pub fn from_bytes(bytes: &[u8]) -> Option<Result<Request, Refusal>> {
        let within = &bytes[..bytes.len().min(MAX_HEAD)];
        let Some(end) = within.windows(4).position(|four| four == b"\r\n\r\n") else {
            return (bytes.len() >= MAX_HEAD).then_some(Err(HEAD_TOO_LARGE));
        };
        let parsed = std::str::from_utf8(&bytes[..end]).map_err(|_| BAD_REQUEST);
        let (mut request, length) = match parsed.and_then(parse) {
            Ok(parsed) => parsed,
            Err(refusal) => return Some(Err(refusal)),
        };
        if length > MAX_BODY {
            return Some(Err(CONTENT_TOO_LARGE));
        }
        request.body = bytes[end + 4..].get(..length)?.to_vec();
        Some(Ok(request))
    }
}

/// Reads a request. Returns `None` if no whole request arrives in time.
pub(crate) async fn read(
    stream: &mut (impl AsyncRead + Unpin),
) -> Option<Result<Request, Refusal>> {
    timeout(TIMEOUT, read_all(stream)).await.ok()?
}

async fn read_all(stream: &mut (impl AsyncRead + Unpin)) -> Option<Result<Request, Refusal>> {
    let mut bytes = Vec::with_capacity(1024);
    loop {
        if let Some(request) = Request::from_bytes(&bytes) {
            return Some(request);
        }
        let limit = (MAX_HEAD + MAX_BODY - bytes.len()) as u64;
        if (&mut *stream).take(limit).read_buf(&mut bytes).await.ok()? == 0 {
            return None;
        }
    }
}

/// Parses the head of a request. Returns the request without its body, and the length of the body.
fn parse(head: &str) -> Result<(Request, usize), Refusal> {
    let mut lines = head.split("\r\n");
    let mut first = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(target), Some("HTTP/1.1"), None) =
        (first.next(), first.next(), first.next(), first.next())
    else {
        return Err(BAD_REQUEST);
    };
    let mut request =
        Request { method: method.to_owned(), target: target.to_owned(), ..Request::default() };
    let (mut hosts, mut lengths, mut is_open) = (0, Vec::new(), false);
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
            "content-length" => lengths.push(content_length(value)?),
            "transfer-encoding" => is_open = true,
            _ => {}
        }
    }
    match (hosts, &lengths[..]) {
        (1, [] | [_]) if is_open => Err(CONTENT_TOO_LARGE),
        (1, []) => Ok((request, 0)),
        (1, [length]) => Ok((request, *length)),
        _ => Err(BAD_REQUEST),
    }
}

fn content_length(text: &str) -> Result<usize, Refusal> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let length = is_number.then(|| text.parse().unwrap_or(usize::MAX));
    length.ok_or(BAD_REQUEST)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_fields_of_a_request_are_read_and_a_part_of_it_is_waited_for() {
        let bytes = "POST /stop HTTP/1.1\r\nHOST: LocalHost:1\r\nOrigin: http://a\r\n\
                     Content-Length: 3\r\nAuthorization: Bearer abc\r\n\r\nxyz and more";
        let expected = Request {
            method: "POST".to_owned(),
            target: "/stop".to_owned(),
            host: "localhost:1".to_owned(),
            origin: Some("http://a".to_owned()),
            is_foreign: false,
            token: Some("abc".to_owned()),
            body: b"xyz".to_vec(),
        };
        let end = bytes.find(" and more").expect("the end");
        assert_eq!(Request::from_bytes(bytes.as_bytes()), Some(Ok(expected)));
        for length in 0..end {
            assert_eq!(Request::from_bytes(&bytes.as_bytes()[..length]), None);
        }
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
            "GET / HTTP/1.1\r\nHost: a\r\nContent-Length: +1",
            "GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 0x1",
            "GET / HTTP/1.1\r\nHost: a\r\nContent-Length:",
            "GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 1",
        ] {
            assert_eq!(parse(head), Err(BAD_REQUEST), "{head}");
        }
    }

    #[test]
    fn long_and_open_bodies_are_refused_before_they_arrive() {
        for field in [
            "Content-Length: 1025",
            "Content-Length: 99999999999999999999999",
            "Transfer-Encoding: chunked\r\nContent-Length: 0",
        ] {
            let head = format!("POST / HTTP/1.1\r\nHost: a\r\n{field}\r\n\r\n");
            let read = Request::from_bytes(head.as_bytes());
            assert_eq!(read, Some(Err(CONTENT_TOO_LARGE)), "{field}");
        }
        let long = vec![b'x'; MAX_HEAD];
        assert_eq!(Request::from_bytes(&long), Some(Err(HEAD_TOO_LARGE)));
        assert_eq!(Request::from_bytes(&long[1..]), None);
    }

    proptest! {
        /// Bytes that arrive later never change what was read.
        #[test]
        fn a_complete_request_stays_as_it_is(
            bytes in proptest::collection::vec(
                prop_oneof![Just(b'\r'), Just(b'\n'), Just(b':'), Just(b' '), any::<u8>()],
                0..200,
            ),
            field in "(Content-Length|Host|Origin|x): ?[0-9a-z]{0,4}",
            more: Vec<u8>,
        ) {
            let head = format!("POST / HTTP/1.1\r\nHost: a\r\n{field}\r\n");
            let all = [head.as_bytes(), &bytes, b"\r\n\r\n", &more].concat();
            let mut first = None;
            for length in 0..=all.len() {
                let read = Request::from_bytes(&all[..length]);
                match &first {
                    Some(first) => prop_assert_eq!(&read, first),
                    None if read.is_some() => first = Some(read),
                    None => {}
                }
            }
        }
    }
}
