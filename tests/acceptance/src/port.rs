//! TCP ports for programs that listen.

use std::io;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::atomic::{AtomicU16, Ordering::Relaxed};

/// Range of the ports: below those that the system assigns to connections (from 32768 on). A
/// program that waits for one of those could be assigned the port itself and connect to itself.
const FIRST: u16 = 20_000;
const COUNT: u16 = 12_000;

/// Ports that this process has returned or found in use.
static TRIED: AtomicU16 = AtomicU16::new(0);

/// Returns a TCP port of 127.0.0.1 that is currently free, another one in each call.
///
/// # Errors
/// No port of the range is free.
pub fn free_port() -> io::Result<u16> {
    // Tests in other processes start elsewhere.
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
