//! A board's port as a TCP port of this machine, for one host at a time.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};

use crate::Port;

/// Bytes that are read at once.
const CHUNK: usize = 4096;

/// A TCP port that stands for the host's end of the cable.
#[derive(Debug)]
pub struct TcpPort {
    listener: TcpListener,
    host: Option<TcpStream>,
    /// What the socket did not take yet.
    waiting: Vec<u8>,
}

impl TcpPort {
    /// Listens at 127.0.0.1; port 0 takes any free one.
    ///
    /// # Errors
    /// The port is occupied, or may not be listened at.
    pub fn listen(port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            host: None,
            waiting: Vec::new(),
        })
    }

    /// The port's number.
    ///
    /// # Errors
    /// The system does not know it.
    pub fn number(&self) -> io::Result<u16> {
        Ok(self.listener.local_addr()?.port())
    }

    /// Whether a host is connected.
    pub const fn is_connected(&self) -> bool {
        self.host.is_some()
    }

    /// Moves bytes in both directions without waiting; returns how many the device has sent. What it sends
    /// while nobody is connected is lost, as on a serial line.
    pub fn serve(&mut self, port: &Port) -> usize {
        if self.host.is_none()
            && let Ok((host, _)) = self.listener.accept()
            && host.set_nonblocking(true).is_ok()
        {
            // Frames are short: none shall wait for more.
            let _ = host.set_nodelay(true);
            self.host = Some(host);
            self.waiting.clear();
        }
        let sent = port.take();
        let Some(host) = &mut self.host else {
            return sent.len();
        };
        // A device that is not there yet, or restarts, is opened when it is.
        port.keep_open();
        self.waiting.extend_from_slice(&sent);
        if exchange(host, &mut self.waiting, port).is_err() {
            self.host = None;
            port.close();
        }
        sent.len()
    }
}

/// An error is the end of the connection.
fn exchange(host: &mut TcpStream, waiting: &mut Vec<u8>, port: &Port) -> io::Result<()> {
    if !waiting.is_empty() {
        match host.write(waiting) {
            Ok(length) => drop(waiting.drain(..length)),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
    let mut bytes = [0; CHUNK];
    if !port.is_open() {
        // What the host sends waits in the socket; its end is seen all the same.
        let mut byte = [0];
        return match host.peek(&mut byte) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            _ => Ok(()),
        };
    }
    loop {
        match host.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(length) => port.send(&bytes[..length]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
            Err(error) => return Err(error),
        }
    }
}
