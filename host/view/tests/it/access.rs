//! Who may load the page, receive the stream and send commands.

use std::io::{Read as _, Write as _};

use view::{Command, Decision, View};

use crate::client::{Served, TOKEN, body, status};

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
    assert!(served.commands.try_recv().is_err(), "a command was passed on");
}

#[test]
fn every_command_is_passed_on_and_answered() {
    let served = Served::start("127.0.0.1:0");
    let cz = Command::Exclude { label: "Cz".to_owned(), decision: Decision::Always };
    for (path, parameter, command) in [
        ("/start", "", Command::Start),
        ("/stop", "", Command::Stop),
        ("/record", "start", Command::Record),
        ("/record", "stop", Command::EndRecording),
        ("/marker", "\u{e4}h", Command::Marker("\u{e4}h".to_owned())),
        ("/exclude", "Cz always", cz),
        ("/rate", "3", Command::Rate(3)),
    ] {
        let response = served.command(path, parameter);
        assert_eq!(status(&response), "200", "{response}");
        assert_eq!(body(&response), r#"{"message":"as you say"}"#);
        assert_eq!(served.commands.try_recv(), Ok(command));
    }
    let refused = served.command("/rate", "16");
    assert_eq!((status(&refused), body(&refused)), ("409", "rates are 0 to 15"));
    let ended = served.command("/self-test", "");
    assert_eq!((status(&ended), body(&ended)), ("503", "the program has ended"));
}

#[test]
fn a_malformed_command_is_refused_with_its_form() {
    let served = Served::start("127.0.0.1:0");
    let (long, longest) = ("x".repeat(201), "x".repeat(1025));
    for (path, parameter, expected, why) in [
        ("/stop", "now", "400", "no body"),
        ("/record", "", "400", "start or stop"),
        ("/record", "/etc/passwd", "400", "start or stop"),
        ("/marker", "", "400", "1 to 200 characters"),
        ("/marker", "two\nlines", "400", "no line breaks"),
        ("/marker", &long, "400", "1 to 200 characters"),
        ("/marker", &longest, "413", "Too Large"),
        ("/exclude", "Cz", "400", "an electrode and always"),
        ("/exclude", "Cz sometimes", "400", "an electrode and always"),
        ("/rate", "many", "400", "one or two digits"),
        ("/quit", "", "405", "Not Allowed"),
    ] {
        let response = served.command(path, parameter);
        assert_eq!(status(&response), expected, "{path} {parameter}");
        assert!(body(&response).contains(why), "{response}");
    }
    // Without the token, nobody learns the form of a command.
    let response = served.request("POST /record", "");
    assert_eq!((status(&response), body(&response)), ("401", "401 Unauthorized"));
    assert!(served.commands.try_recv().is_err());
}

#[test]
fn the_stream_needs_the_token_unless_the_page_is_on_loopback() {
    let served = Served::start("0.0.0.0:0");
    for (fields, expected) in [
        (String::new(), "401"),
        (bearer("abc"), "401"),
        (format!("Origin: http://example.org\r\n{}", bearer(TOKEN)), "403"),
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
    assert_eq!(status(&response), "431");
    for request in ["\r\n\r\n", "\u{16}\u{3}\u{1}\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/1.1\r\n\r\n"]
    {
        let mut stream = served.connect();
        stream.write_all(request.as_bytes()).unwrap();
        let response = std::io::read_to_string(stream).unwrap();
        assert_eq!(status(&response), "400", "{request:?}");
    }
}

#[test]
fn ten_megabytes_are_refused_and_cost_no_other_client_a_thing() {
    let served = Served::start("127.0.0.1:0");
    let body_of = "x".repeat(10 << 20);
    let own = format!("Origin: http://{}\r\n{}", served.address, bearer(TOKEN));
    let stated = format!("{own}Content-Length: {}\r\n", body_of.len());
    for (fields, expected) in
        [(stated.as_str(), "413"), (&format!("{own}Transfer-Encoding: chunked\r\n"), "413")]
    {
        let response = served.request_with("POST /marker", fields, &body_of);
        assert_eq!(status(&response), expected, "{response}");
    }
    assert_eq!(status(&served.command("/start", "")), "200");
    assert_eq!(served.commands.try_recv(), Ok(Command::Start));
}

#[test]
fn only_a_random_token_is_in_the_address() {
    assert!(!Served::start("127.0.0.1:0").view.url().contains(TOKEN));
    let view = View::start("127.0.0.1:0".parse().unwrap(), None, |_, _| {}).unwrap();
    let (_, token) = view.url().split_once("/#token=").unwrap();
    assert_eq!(token.len(), 32);
}
