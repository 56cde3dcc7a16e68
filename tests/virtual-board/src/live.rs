//! Runs a board for a host at a TCP port, in real time or slower, one host at a time.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use crate::findings::BoardError;
use crate::machine::VirtualBoard;
use crate::port::Port;

/// Interval at which bytes are transferred between board and host, in us of virtual time.
const SLICE_US: u64 = 1_000;

/// Time without SPI or port traffic after which a board counts as stopped, in us of virtual time.
/// The firmware retries a failed start of the converters at shorter intervals, so such a board does
/// not count as stopped.
const IDLE_US: u64 = 10_000_000;

/// Interval between two status lines on the console, in us of virtual time.
const REPORT_US: u64 = 10_000_000;

/// Runs a board for a host that connects to the TCP port, never faster than real time, until `stop`
/// is true or `seconds` of virtual time since power-on have passed.
///
/// # Errors
/// The emulator fails, or the board has had no SPI or port traffic for 10 s of virtual
/// time. The error contains a diagnosis.
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
            return Err(board.error(format!(
                "no progress for {} s of virtual time",
                IDLE_US / 1_000_000
            )));
        }
        if now - reported >= REPORT_US {
            let count = board.findings()?.resets.len();
            reported = now;
            let real = start.elapsed().as_secs_f64();
            let state = if tcp.is_connected() {
                "a host is connected"
            } else {
                "no host is connected"
            };
            // The board keeps running even if the console is closed.
            let _ = writeln!(
                console,
                "{} s of virtual time in {real:.0} s, {sent} bytes to the host, {count} resets, {state}",
                now / 1_000_000,
            );
        }
        let ahead = Duration::from_micros(now - first_us).saturating_sub(start.elapsed());
        // Sleeps only when more than 5 ms ahead of real time, to avoid a thousand wake-ups per
        // second.
        if ahead > Duration::from_millis(5) {
            thread::sleep(ahead);
        }
    }
    Ok(())
}

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

    /// Returns the number of the TCP port. If 0 was requested, this is the number that the
    /// operating system has chosen.
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

    /// Transfers bytes in both directions without blocking, and returns the number of bytes that
    /// the device has sent since the last call. Bytes that it sends while no host is connected are
    /// lost, as on a serial line.
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
        // The port of a device that has just been configured, for example after a restart, is still
        // closed.
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
