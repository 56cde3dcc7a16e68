//! Fuzz target for what browsers and other programs send to the live page.

use view::{Command, Request};

use crate::Outcome;

pub(crate) fn request_seeds() -> Vec<Vec<u8>> {
    [
        "GET /places?Cz,Fz HTTP/1.1\r\nHost: localhost:8061\r\nSec-Fetch-Site: same-origin\r\n\r\n",
        "POST /marker HTTP/1.1\r\nHost: a\r\nOrigin: http://a\r\nAuthorization: Bearer abc\r\n\
         Content-Length: 4\r\n\r\neyes",
        "POST /exclude HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\nCz always",
        "POST /record HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\nstart",
        "POST /rate HTTP/1.1\r\nHost: a\r\nContent-Length: 2\r\n\r\n15",
    ]
    .map(|request| request.as_bytes().to_vec())
    .into()
}

/// Parses bytes as a request, and the request's body as each kind of command. The parsed request
/// must stay the same when more bytes follow, and the contents of a command must be within their
/// limits.
pub(crate) fn request(bytes: &[u8]) -> Outcome {
    let read = Request::from_bytes(bytes);
    if read.is_some() {
        let longer = [bytes, b"\r\n\r\nmore"].concat();
        assert_eq!(Request::from_bytes(&longer), read);
    }
    let Some(Ok(request)) = read else {
        return Outcome::Refused;
    };
    assert!(request.body.len() <= 1024);
    for path in [&*request.target, "/start", "/record", "/marker", "/exclude", "/rate"] {
        match Command::parse(path, &request.body) {
            Some(Ok(Command::Marker(text))) => {
                assert!((1..=view::MAX_MARKER).contains(&text.chars().count()));
                assert!(!text.contains(char::is_control));
            }
            Some(Ok(Command::Exclude { label, .. })) => {
                assert!(!label.is_empty() && !label.contains(char::is_whitespace));
            }
            Some(Ok(Command::Rate(rate))) => assert!(rate <= 99),
            _ => {}
        }
    }
    Outcome::Accepted
}
