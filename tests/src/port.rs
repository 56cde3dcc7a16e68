//! TCP ports for programs that listen.

use std::io;
use std::net::{Ipv4Addr, TcpListener};

/// Returns a TCP port of 127.0.0.1 that is currently free.
///
/// # Errors
/// The system has no free port.
pub fn free_port() -> io::Result<u16> {
    Ok(TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?
        .local_addr()?
        .port())
}
