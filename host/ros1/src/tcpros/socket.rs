//! Sets the socket options of TCPROS connections.

use std::{io, time::Duration};

use socket2::{SockRef, TcpKeepalive};
use tokio::net::TcpStream;

/// Idle time before the first TCP keepalive probe.
const KEEPALIVE_TIME: Duration = Duration::from_secs(10);
/// Time between two TCP keepalive probes.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);
/// Number of unanswered TCP keepalive probes after which the connection is closed. This happens
/// 25 s (10 s + 3 * 5 s) after the last byte from the peer.
const KEEPALIVE_PROBES: u32 = 3;

/// Disables Nagle's algorithm, so that small messages are sent at once, and enables keepalive.
/// Without keepalive, a side that only receives would never detect that its peer has vanished
/// (power cut, unplugged cable).
pub(crate) fn set_options(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let keepalive = TcpKeepalive::new()
        .with_time(KEEPALIVE_TIME)
        .with_interval(KEEPALIVE_INTERVAL)
        .with_retries(KEEPALIVE_PROBES);
    SockRef::from(stream).set_tcp_keepalive(&keepalive)
}
