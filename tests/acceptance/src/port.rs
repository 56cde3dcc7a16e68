//! Free TCP ports for programs that tests start.

use std::io;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::atomic::{AtomicU16, Ordering::Relaxed};

/// First port that a test may use, and number of such ports. All are below 32768, the start of the
/// range for outgoing connections: a program that tries to connect to a port in that range could
/// get this port for its own end, and so connect to itself.
const FIRST: u16 = 20_000;
const COUNT: u16 = 12_000;

/// Number of ports that this process has tried so far.
static TRIED: AtomicU16 = AtomicU16::new(0);

/// Returns a free TCP port in the format of the options `--port` and `--output`.
///
/// # Panics
/// When no port of the range is free.
pub fn free_address() -> String {
    format!("tcp:127.0.0.1:{}", free_port().expect("a free port"))
}

/// Returns a free TCP port of 127.0.0.1. No two calls in one process return the same port.
///
/// # Errors
/// No port of the range is free.
pub fn free_port() -> io::Result<u16> {
    // Start at a port that depends on the process, so that tests in other processes try other ports
    // first.
    let start = std::process::id().wrapping_mul(0x9e37_79b9) >> 16;
    let start = u16::try_from(start).unwrap_or_default() % COUNT;
    loop {
        let tried = TRIED.fetch_add(1, Relaxed);
        let port = FIRST + (start + tried % COUNT) % COUNT;
        match TcpListener::bind((Ipv4Addr::LOCALHOST, port)) {
            Ok(_) => return Ok(port),
            Err(error) if tried >= COUNT => return Err(error),
            Err(_) => {}
        }
    }
}
