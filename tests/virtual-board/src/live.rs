//! Runs a virtual board, in real time or slower, for one host at a time on a TCP port.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use crate::findings::BoardError;
use crate::machine::VirtualBoard;
use crate::port::Port;

/// Virtual time in us between two transfers of bytes between board and host.
const SLICE_US: u64 = 1_000;

/// Virtual time in us without SPI or port traffic after which a board counts as stopped. A board
/// that cannot start its converters does not count as stopped, because its firmware tries again
/// more often than this.
const IDLE_US: u64 = 10_000_000;

/// Virtual time in us between two status lines on the console.
const REPORT_US: u64 = 10_000_000;

/// Runs a board until `stop` is true or `seconds` of virtual time since power-on have passed, never
/// faster than real time, for a host that connects to the TCP port.
///
/// # Errors
/// The emulator fails, or the board has had no SPI or port traffic for 10 s of virtual time. The
/// error contains a diagnosis.
pub fn run(
    board: &mut VirtualBoard,
    tcp: &mut TcpPort,
    seconds: Option<u64>,
    stop: &AtomicBool,
    mut console: impl Write,
) -> Result<(), BoardError> {
    let start = Instant::now();
    let first_us = board.now_us();
    let (mut progressed_us, mut traffic, mut sent) = (first_us, 0, 0_u64);
    let mut reported = first_us;
    while !stop.load(Relaxed) && seconds.is_none_or(|seconds| board.now_us() < seconds * 1_000_000)
    {
        board.advance_us(SLICE_US)?;
        let now = board.now_us();
        sent += tcp.serve(board.port()) as u64;
        let total = board.spi_words() + sent;
        if total != traffic {
            (progressed_us, traffic) = (now, total);
        }
        if now - progressed_us > IDLE_US {
            return Err(
                board.error(format!("no progress for {} s of virtual time", IDLE_US / 1_000_000))
            );
        }
        if now - reported >= REPORT_US {
            let count = board.findings()?.resets.len();
            reported = now;
            let real = start.elapsed().as_secs_f64();
            let state =
                if tcp.is_connected() { "a host is connected" } else { "no host is connected" };
            // Ignore errors, so that the board keeps running when the console is closed.
            let _ = writeln!(
                console,
                "{} s of virtual time in {real:.0} s, {sent} bytes to the host, {count} resets, {state}",
                now / 1_000_000,
            );
        }
        let ahead = Duration::from_micros(now - first_us).saturating_sub(start.elapsed());
        // Sleep only when the board is more than 5 ms ahead of real time; otherwise this thread
        // would wake up a thousand times per second.
        if ahead > Duration::from_millis(5) {
            thread::sleep(ahead);
        }
    }
    Ok(())
}

/// Largest number of bytes that are read from the socket at once.
const CHUNK: usize = 4096;

/// A TCP port that exchanges bytes with the host's end of a virtual board's port.
#[derive(Debug)]
pub struct TcpPort {
    listener: TcpListener,
    host: Option<TcpStream>,
    /// Bytes from the device that still have to be written to the socket.
    waiting: Vec<u8>,
}

impl TcpPort {
    /// Listens on TCP port `port` of 127.0.0.1; 0 lets the operating system choose a free port.
    ///
    /// # Errors
    /// The port is occupied, or listening on it is not permitted.
    pub fn listen(port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, host: None, waiting: Vec::new() })
    }

    /// Returns the number of the TCP port, chosen by the operating system if 0 was requested.
    ///
    /// # Errors
    /// The operating system does not return the local address.
    pub fn number(&self) -> io::Result<u16> {
        Ok(self.listener.local_addr()?.port())
    }

    /// Returns whether a host was connected at the end of the last call of [`serve`](Self::serve).
    pub const fn is_connected(&self) -> bool {
        self.host.is_some()
    }

    /// Transfers bytes in both directions without blocking, and returns how many bytes the device
    /// has sent since the last call. Bytes that the device sends while no host is connected are
    /// lost, as on a serial line.
    pub fn serve(&mut self, port: &Port) -> usize {
        if self.host.is_none()
            && let Ok((host, _)) = self.listener.accept()
            && host.set_nonblocking(true).is_ok()
        {
            // Send each frame at once, although it is short, instead of waiting for more data.
            let _ = host.set_nodelay(true);
            self.host = Some(host);
            self.waiting.clear();
        }
        let sent = port.take_received();
        let Some(host) = &mut self.host else {
            return sent.len();
        };
        // Open the port again if it is closed and the device is configured, for example after a
        // restart of the device.
        port.keep_open();
        self.waiting.extend_from_slice(&sent);
        if exchange(host, &mut self.waiting, port).is_err() {
            self.host = None;
            port.close();
        }
        sent.len()
    }
}

/// Transfers bytes between socket and port. Returns an error if the connection has ended.
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
        // Leave bytes in the socket until the port is open, but detect the connection's end.
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
