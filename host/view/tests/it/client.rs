//! A view that records its commands, and clients for the tests.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use view::{Command, Reply, View};

/// Timeout of every wait in these tests, sufficient for a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(30);

pub(crate) const TOKEN: &str = "0123456789abcdefXYZ_-";

/// A running view, and the commands that it has passed on.
pub(crate) struct Served {
    pub(crate) view: View,
    pub(crate) address: SocketAddr,
    pub(crate) commands: Receiver<Command>,
}

impl Served {
    pub(crate) fn start(address: &str) -> Served {
        let (sender, commands) = channel();
        let on_command = move |command, reply: Reply| {
            match &command {
                Command::Rate(16..) => reply.refuse("rates are 0 to 15"),
                // Drop the reply, as a program does that ends.
                Command::SelfTest => drop(reply),
                _ => reply.done("as you say"),
            }
            sender.send(command).unwrap();
        };
        let token = Some(TOKEN.parse().unwrap());
        let view = View::start(address.parse().unwrap(), token, on_command).unwrap();
        let url = view.url().trim_start_matches("http://");
        let mut address: SocketAddr = url.trim_end_matches('/').parse().unwrap();
        if address.ip().is_unspecified() {
            address.set_ip([127, 0, 0, 1].into());
        }
        Served { view, address, commands }
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        stream
    }

    /// Sends a request with further `fields`, each with a line end. Returns the whole response.
    pub(crate) fn request(&self, line: &str, fields: &str) -> String {
        self.request_with(line, fields, "")
    }

    /// Sends a request with a body. The fields must state the body's length.
    pub(crate) fn request_with(&self, line: &str, fields: &str, body: &str) -> String {
        let mut stream = self.connect();
        let host = self.address;
        let request = format!("{line} HTTP/1.1\r\nHost: {host}\r\n{fields}\r\n{body}");
        let mut response = String::new();
        // The server closes the connection without reading all of a request that is too long.
        let _ = stream.write_all(request.as_bytes());
        let _ = stream.read_to_string(&mut response);
        response
    }

    /// Sends a command as the page does.
    pub(crate) fn command(&self, path: &str, body: &str) -> String {
        let address = self.address;
        let length = body.len();
        let fields = format!(
            "Origin: http://{address}\r\nAuthorization: Bearer {TOKEN}\r\nContent-Length: {length}\r\n"
        );
        self.request_with(&format!("POST {path}"), &fields, body)
    }

    /// Starts a stream of messages, and returns the connection after the response's head.
    pub(crate) fn view(&self) -> TcpStream {
        let mut stream = self.connect();
        let request = format!(
            "GET /stream HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {TOKEN}\r\n\r\n",
            self.address
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        assert!(head.starts_with(b"HTTP/1.1 200 "));
        stream
    }
}

pub(crate) fn body(response: &str) -> &str {
    response.split_once("\r\n\r\n").unwrap().1
}

/// Returns the status code of a response.
pub(crate) fn status(response: &str) -> &str {
    response.split(' ').nth(1).unwrap_or(response)
}

/// Reads a message, and returns the bytes after its length field.
pub(crate) fn read_message(stream: &mut TcpStream) -> Vec<u8> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).unwrap();
    let mut message = vec![0; u32::from_le_bytes(length) as usize];
    stream.read_exact(&mut message).unwrap();
    message
}

pub(crate) fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + TIMEOUT;
    while !holds() {
        assert!(Instant::now() < deadline, "{what}: not within {TIMEOUT:?}");
        std::thread::sleep(Duration::from_millis(1));
    }
}
