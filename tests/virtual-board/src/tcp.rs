//! A board's port as a local TCP port, for one host at a time.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};

use crate::port::Port;

/// Largest number of bytes read from the socket per call.
const CHUNK: usize = 4096;

/// A TCP port that exchanges bytes with the host's end of a board's port.
#[derive(Debug)]
pub struct TcpPort {
    listener: TcpListener,
    host: Option<TcpStream>,
    /// Bytes from the device that the socket has not accepted yet.
    waiting: Vec<u8>,
}

impl TcpPort {
    /// Listens on 127.0.0.1. If `port` is 0, the operating system chooses a free port.
    ///
    /// # Errors
    /// The port is occupied, or listening on it is not permitted.
    pub fn listen(port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            host: None,
            waiting: Vec::new(),
        })
    }

    /// Returns the number of the TCP port. If 0 was requested, this is the number that the operating system
    /// has chosen.
    ///
    /// # Errors
    /// The operating system does not return the local address.
    pub fn number(&self) -> io::Result<u16> {
        Ok(self.listener.local_addr()?.port())
    }

    /// Returns whether a host was connected at the last call of [`serve`](Self::serve).
    pub const fn is_connected(&self) -> bool {
        self.host.is_some()
    }

    /// Transfers bytes in both directions without blocking, and returns the number of bytes that the device
    /// has sent since the last call. Bytes that it sends while no host is connected are lost, as on a
    /// serial line.
    pub fn serve(&mut self, port: &Port) -> usize {
        if self.host.is_none()
            && let Ok((host, _)) = self.listener.accept()
            && host.set_nonblocking(true).is_ok()
        {
            // Frames are short and must be sent without waiting for more data.
            let _ = host.set_nodelay(true);
            self.host = Some(host);
            self.waiting.clear();
        }
        let sent = port.take_received();
        let Some(host) = &mut self.host else {
            return sent.len();
        };
        // The port of a device that has just been configured, for example after a restart, is still closed.
        port.keep_open();
        self.waiting.extend_from_slice(&sent);
        if exchange(host, &mut self.waiting, port).is_err() {
            self.host = None;
            port.close();
        }
        sent.len()
    }
}

/// Transfers bytes between socket and port. An error means that the connection has ended.
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
        // Leave received bytes in the socket, but detect the end of the connection.
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
