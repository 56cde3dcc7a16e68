//! Network addresses: parses the addresses of peers, and chooses the address of a node.

use std::{
    fmt, io,
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    time::Duration,
};

use tokio::{
    net::{TcpStream, UdpSocket, lookup_host},
    time::timeout,
};

/// Time limit for resolving a host name. Shorter than the limit of an XML-RPC call, so that the
/// call fails with the resolver's error instead of a timeout.
const LOOKUP_TIMEOUT: Duration = Duration::from_millis(2500);

/// Error for a URI that lacks a host or a port, so that no connection can be opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{uri} is not SCHEME://HOST:PORT; an example is http://127.0.0.1:11311/")]
pub struct AddressError {
    /// The URI as it was configured or received.
    pub uri: String,
}

/// Error for a host name that has no address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the host name {host} does not resolve: {reason}")]
pub struct LookupError {
    /// Host name that was looked up.
    pub host: Box<str>,
    /// Error message from the operating system, or a note that no answer came within 2.5 s.
    pub reason: Box<str>,
}

/// Why no connection to a peer could be opened.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// The host name of the peer has no address.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// The peer did not accept the connection.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Resolves `host`, a name or an IP address. Returns its socket addresses with the port `port`.
async fn lookup(host: &str, port: u16) -> Result<Vec<SocketAddr>, LookupError> {
    let found = timeout(LOOKUP_TIMEOUT, lookup_host((host, port))).await;
    let found = found.unwrap_or_else(|_| {
        let late = "no answer within 2.5 s";
        Err(io::Error::new(io::ErrorKind::TimedOut, late))
    });
    found
        .map(Iterator::collect)
        .map_err(|error| LookupError { host: host.into(), reason: error.to_string().into() })
}

/// Resolves a host name or address. Returns each address with whether it belongs to this machine.
///
/// # Errors
/// The host has no address, or none was found within 2.5 s.
pub async fn host_addresses(host: &str) -> Result<Vec<(IpAddr, bool)>, LookupError> {
    let host = host.trim_matches(['[', ']']);
    let mut addresses = Vec::new();
    for address in lookup(host, 0).await? {
        // Only an address of this machine can be bound.
        let is_own = UdpSocket::bind(address).await.is_ok();
        addresses.push((address.ip(), is_own));
    }
    Ok(addresses)
}

/// Host and TCP port of a peer. An IPv6 address is stored without the square brackets that enclose
/// it in a URI.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Address {
    pub(crate) host: String,
    pub(crate) port: u16,
}

impl Address {
    /// Parses `SCHEME://HOST:PORT`, with or without a path, such as `http://HOST:PORT/` and
    /// `rosrpc://HOST:PORT`.
    pub(crate) fn parse(uri: &str) -> Result<Self, AddressError> {
        let error = || AddressError { uri: uri.to_owned() };
        let (_, rest) = uri.split_once("://").ok_or_else(error)?;
        let authority = rest.split('/').next().unwrap_or_default();
        let (host, port) = authority.rsplit_once(':').ok_or_else(error)?;
        let host = match host.strip_prefix('[') {
            Some(inner) => inner.strip_suffix(']').ok_or_else(error)?,
            None => host,
        };
        if host.is_empty() {
            return Err(error());
        }
        Ok(Self { host: host.to_owned(), port: port.parse().map_err(|_| error())? })
    }

    /// Creates an address. An IPv6 address in `host` can have square brackets or not.
    pub(crate) fn new(host: &str, port: u16) -> Self {
        Self { host: host.trim_start_matches('[').trim_end_matches(']').to_owned(), port }
    }

    /// Opens a connection to the first address of the host that accepts one.
    pub(crate) async fn connect(&self) -> Result<TcpStream, ConnectError> {
        let addresses = lookup(&self.host, self.port).await?;
        Ok(TcpStream::connect(&*addresses).await?)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.host.contains(':') {
            write!(f, "[{}]:{}", self.host, self.port)
        } else {
            write!(f, "{}:{}", self.host, self.port)
        }
    }
}

/// Returns the local address to listen on so that peers can connect to `host`. If `host` is a
/// loopback address or name, only programs on this machine can connect.
pub(crate) fn listen_address(host: &str, ipv6: bool) -> IpAddr {
    match host.parse::<IpAddr>() {
        Ok(address) if address.is_loopback() => address,
        Ok(IpAddr::V6(_)) => Ipv6Addr::UNSPECIFIED.into(),
        Err(_) if host == "localhost" => Ipv4Addr::LOCALHOST.into(),
        Err(_) if ipv6 => Ipv6Addr::UNSPECIFIED.into(),
        Ok(IpAddr::V4(_)) | Err(_) => Ipv4Addr::UNSPECIFIED.into(),
    }
}

/// Returns the address of the network interface on the route to the master; the master can call the
/// node back at this address. Without a route to the master, returns the address of the default
/// route, which is found by routing to 192.0.2.1 (TEST-NET-1, RFC 5737). Without a default route,
/// returns loopback. No packet is sent: connecting a UDP socket only selects a route.
pub(crate) async fn own_address(master: &Address) -> IpAddr {
    for (host, port) in [(master.host.as_str(), master.port), ("192.0.2.1", 9)] {
        let Ok(mut targets) = lookup(host, port).await else {
            continue;
        };
        // Try IPv4 first: most ROS 1 peers support only IPv4, but `localhost` resolves to IPv4 and
        // IPv6.
        targets.sort_by_key(SocketAddr::is_ipv6);
        for target in targets {
            if let Ok(address) = local_address_towards(target).await {
                return address;
            }
        }
    }
    tracing::warn!("no route to the master; set ROS_IP, or other machines cannot reach this node");
    Ipv4Addr::LOCALHOST.into()
}

async fn local_address_towards(target: SocketAddr) -> io::Result<IpAddr> {
    let any: IpAddr = match target {
        SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
        SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
    };
    let socket = UdpSocket::bind((any, 0)).await?;
    socket.connect(target).await?;
    Ok(socket.local_addr()?.ip())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ipv4_ipv6_and_host_names_survive_a_round_trip() {
        for (uri, host, port, text) in [
            ("http://127.0.0.1:11311/", "127.0.0.1", 11311, "127.0.0.1:11311"),
            ("http://[::1]:11311", "::1", 11311, "[::1]:11311"),
            ("rosrpc://robot:40001", "robot", 40001, "robot:40001"),
        ] {
            let address = Address::parse(uri).unwrap();
            assert_eq!((address.host.as_str(), address.port), (host, port));
            assert_eq!(address.to_string(), text);
        }
    }

    #[tokio::test]
    async fn an_address_of_this_machine_is_told_from_a_foreign_one_and_from_none() {
        assert!(host_addresses("127.0.0.1").await.unwrap()[0].1);
        // No machine has this address: RFC 5737 reserves it for documentation.
        assert!(!host_addresses("192.0.2.1").await.unwrap()[0].1);
        // A name that never resolves: RFC 6761 reserves `.invalid`.
        let error = host_addresses("no-such-host.invalid").await.unwrap_err();
        assert_eq!(&*error.host, "no-such-host.invalid");
    }

    #[test]
    fn uris_without_host_and_port_are_refused() {
        for uri in ["", "127.0.0.1:1", "http://host/", "http://host:port/", "http://:1/"] {
            assert_eq!(Address::parse(uri), Err(AddressError { uri: uri.to_owned() }));
        }
    }
}
