//! Who may load the page, receive the stream and send commands.

use std::io::{Read as _, Write as _};

use view::{Command, View};

use crate::client::{Served, TOKEN, status};

fn bearer(token: &str) -> String {
    format!("Authorization: Bearer {token}\r\n")
}

#[test]
fn a_command_needs_the_token_and_the_own_origin() {
    let served = Served::start("127.0.0.1:0");
    let origin = |of: &str| format!("Origin: {of}\r\n");
    let own = origin(&format!("http://{}", served.address));
    let wrong = bearer("0123456789abcdefXYZ_+");
    let right = bearer(TOKEN);
    for (fields, expected) in [
        (String::new(), "401"),
        (own.clone(), "401"),
        (format!("{own}{wrong}"), "401"),
        (right.clone(), "403"),
        (format!("{}{right}", origin("http://example.org")), "403"),
        (format!("{}{right}", origin("null")), "403"),
        (format!("{own}{right}Content-Length: 10485760\r\n"), "413"),
    ] {
        let response = served.request("POST /stop", &fields);
        assert_eq!(status(&response), expected, "{fields}");
    }
    assert_eq!(status(&served.request("GET /stop", &right)), "404");
    assert!(
        served.commands.try_recv().is_err(),
        "a command was passed on"
    );
    for (path, command) in [("/start", Command::Start), ("/stop", Command::Stop)] {
        let response = served.request(&format!("POST {path}"), &format!("{own}{right}"));
        assert_eq!(status(&response), "204");
        assert_eq!(served.commands.try_recv(), Ok(command));
    }
}

#[test]
fn the_stream_needs_the_token_unless_the_page_is_on_loopback() {
    let served = Served::start("0.0.0.0:0");
    for (fields, expected) in [
        (String::new(), "401"),
        (bearer("abc"), "401"),
        (
            format!("Origin: http://example.org\r\n{}", bearer(TOKEN)),
            "403",
        ),
    ] {
        let response = served.request("GET /stream", &fields);
        assert_eq!(status(&response), expected, "{fields}");
    }
    assert_eq!(status(&served.request("GET /", "")), "200");
    assert_eq!(status(&served.request("GET /stream?token=x", "")), "401");
    drop(served.view());

    let local = Served::start("127.0.0.1:0");
    drop(local.view());
    assert_eq!(status(&local.request("GET /stream", &bearer("abc"))), "401");
    let foreign = "Sec-Fetch-Site: cross-site\r\n";
    assert_eq!(status(&local.request("GET /stream", foreign)), "403");
    let mut open = local.connect();
    let request = format!("GET /stream HTTP/1.1\r\nHost: {}\r\n\r\n", local.address);
    open.write_all(request.as_bytes()).unwrap();
    let mut head = [0; 12];
    open.read_exact(&mut head).unwrap();
    assert_eq!(head, *b"HTTP/1.1 200");
}

#[test]
fn on_loopback_no_other_host_name_leads_to_the_page() {
    let served = Served::start("127.0.0.1:0");
    for (host, expected) in [
        (served.address.to_string(), "200"),
        (format!("LOCALHOST:{}", served.address.port()), "200"),
        ("example.org".to_owned(), "403"),
        (format!("example.org:{}", served.address.port()), "403"),
        ("127.0.0.1".to_owned(), "403"),
    ] {
        let mut stream = served.connect();
        let request = format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let response = std::io::read_to_string(stream).unwrap();
        assert_eq!(status(&response), expected, "{host}");
    }
}

#[test]
fn no_path_leads_to_a_file_and_every_response_forbids_other_sources() {
    let served = Served::start("127.0.0.1:0");
    for path in [
        "/../Cargo.toml",
        "/..%2f..%2fetc/passwd",
        "/%2e%2e/Cargo.toml",
        "//etc/passwd",
        "/style.css/../../Cargo.toml",
        "/page/index.html",
        "http://example.org/",
        "*",
    ] {
        let response = served.request(&format!("GET {path}"), "");
        assert_eq!(status(&response), "404", "{path}");
        assert!(response.contains("\r\nContent-Security-Policy: default-src 'none';"));
    }
    let page = served.request("GET /", "");
    let names = page.split(['"', '\'']).filter(|text| text.starts_with('/'));
    let mut count = 0;
    for name in names.filter(|name| name.contains('.')) {
        let file = served.request(&format!("GET {name}"), "");
        assert_eq!(status(&file), "200", "{name}");
        count += 1;
    }
    assert_eq!(count, 3, "icon, style and script");
    for outside in ["http:", "https:", "<script>", "style=", "eval("] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert_eq!(status(&served.request("PUT /", "")), "405");
}

#[test]
fn long_and_malformed_requests_are_refused() {
    let served = Served::start("127.0.0.1:0");
    let fields = format!("Field: {}\r\n", "x".repeat(10 << 20));
    let response = served.request("GET /", &fields);
    // The client can be cut off before it has read the response.
    assert!(
        response.is_empty() || status(&response) == "431",
        "{response}"
    );
    for request in [
        "\r\n\r\n",
        "\u{16}\u{3}\u{1}\r\n\r\n",
        "GET\r\n\r\n",
        "GET / HTTP/1.1\r\n\r\n",
    ] {
        let mut stream = served.connect();
        stream.write_all(request.as_bytes()).unwrap();
        let response = std::io::read_to_string(stream).unwrap();
        assert_eq!(status(&response), "400", "{request:?}");
    }
    let body = format!("Content-Length: {}\r\n", 10 << 20);
    assert_eq!(status(&served.request("POST /start", &body)), "413");
}

#[test]
fn only_a_random_token_is_in_the_address() {
    assert!(!Served::start("127.0.0.1:0").view.url().contains(TOKEN));
    let view = View::start("127.0.0.1:0".parse().unwrap(), None, |_| {}).unwrap();
    let (_, token) = view.url().split_once("/#token=").unwrap();
    assert_eq!(token.len(), 32);
}
