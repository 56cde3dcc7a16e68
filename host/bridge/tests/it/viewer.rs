//! A viewer of the live page: the stream of its messages.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};

use crate::process::{TIMEOUT, wait_until};

/// Starts a stream of the live page's messages.
pub(crate) fn view(address: SocketAddr) -> BufReader<TcpStream> {
    let mut stream = None;
    wait_until("the live page", || {
        stream = TcpStream::connect(address).ok();
        stream.is_some()
    });
    let mut stream = stream.unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    let request = format!("GET /stream HTTP/1.1\r\nHost: {address}\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    assert_eq!(line, "HTTP/1.1 200 OK\r\n");
    while line != "\r\n" {
        line.clear();
        reader.read_line(&mut line).unwrap();
    }
    reader
}

/// Reads messages until the first one of topic number `topic`, and returns its body.
pub(crate) fn next(reader: &mut BufReader<TcpStream>, topic: u8) -> Vec<u8> {
    loop {
        let mut length = [0; 4];
        reader.read_exact(&mut length).unwrap();
        let mut message = vec![0; u32::from_le_bytes(length) as usize];
        reader.read_exact(&mut message).unwrap();
        if message[0] == topic {
            return message.split_off(9);
        }
    }
}
