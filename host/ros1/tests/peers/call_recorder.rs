//! A node that records the calls it receives and answers each with success.

use std::{
    io::{BufRead as _, BufReader, Read as _, Write as _},
    net::{TcpListener, TcpStream},
    sync::{Arc, Mutex},
};

use ros1::xmlrpc::{MethodCall, Value, decode_call, encode_response};

pub(crate) struct CallRecorder {
    pub(crate) uri: String,
    calls: Arc<Mutex<Vec<MethodCall>>>,
}

impl CallRecorder {
    pub(crate) fn start() -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let uri = format!("http://{}/", listener.local_addr().unwrap());
        let calls = Arc::new(Mutex::new(Vec::new()));
        let recorded = Arc::clone(&calls);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let recorded = Arc::clone(&recorded);
                std::thread::spawn(move || answer_all(&stream.unwrap(), &recorded));
            }
        });
        Self { uri, calls }
    }

    pub(crate) fn calls(&self) -> Vec<MethodCall> {
        self.calls.lock().unwrap().clone()
    }
}

fn answer_all(stream: &TcpStream, calls: &Mutex<Vec<MethodCall>>) {
    let mut reader = BufReader::new(stream);
    loop {
        let mut length = 0;
        let mut line = String::new();
        loop {
            line.clear();
            if reader.read_line(&mut line).unwrap_or(0) == 0 {
                return;
            }
            if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
                length = value.trim().parse().unwrap();
            }
            if line.trim().is_empty() {
                break;
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body).unwrap();
        calls.lock().unwrap().push(decode_call(&body).unwrap());
        let triple = Value::Array(vec![1.into(), "".into(), 0.into()]);
        let body = encode_response(&Ok(triple));
        let head = format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n", body.len());
        let mut writer = stream;
        if writer.write_all((head + &body).as_bytes()).is_err() {
            return;
        }
    }
}
