//! Chooses the network addresses of a node: the address to listen on and the address to report to
//! the master.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
};

use tokio::net::UdpSocket;

use crate::address::Address;

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
    for (host, port) in [(master.host(), master.port()), ("192.0.2.1", 9)] {
        let Ok(targets) = tokio::net::lookup_host((host, port)).await else {
            continue;
        };
        // Try IPv4 first: most ROS 1 peers support only IPv4, but `localhost` resolves to IPv4 and
        // IPv6.
        let mut targets: Vec<SocketAddr> = targets.collect();
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
