//! The options of every TCPROS socket.

use std::{io, time::Duration};

use socket2::{SockRef, TcpKeepalive};
use tokio::net::TcpStream;

/// A connection that carries nothing for so long is probed.
const KEEPALIVE_TIME: Duration = Duration::from_secs(10);
/// From one probe to the next.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);
/// So many probes without an answer end the connection: 25 s after the last byte.
const KEEPALIVE_PROBES: u32 = 3;

/// Small messages go out at once, and a peer that vanished without a word (power cut, cable) is
/// noticed: nothing else would tell who only waits for it.
pub(crate) fn set_options(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let keepalive = TcpKeepalive::new()
        .with_time(KEEPALIVE_TIME)
        .with_interval(KEEPALIVE_INTERVAL)
        .with_retries(KEEPALIVE_PROBES);
    SockRef::from(stream).set_tcp_keepalive(&keepalive)
}
