//! A ROS 1 master for demonstrations and tests. Its replies equal rosmaster's, including the
//! wording of the messages.

mod api;
mod arguments;
mod notifier;
mod parameters;
mod registrations;

use std::{
    io,
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    sync::Arc,
};

use tokio::{
    net::TcpListener,
    sync::{Mutex, watch},
};

use crate::{address::Address, xmlrpc::Server};
use api::Api;

/// A running master. Dropping the master stops it without waiting; only [`Master::shutdown`] waits
/// until the port is free.
#[derive(Debug)]
pub struct Master {
    uri: String,
    server: Mutex<Option<Server>>,
    shutdown_requested: watch::Receiver<bool>,
}

impl Master {
    /// Starts a master that listens on `address`. Port 0 chooses a free port.
    ///
    /// # Errors
    /// The operating system refuses to listen: the port is in use, or `address` does not belong to
    /// this machine.
    pub async fn start(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address).await?;
        let local = listener.local_addr()?;
        let host = match local.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
            ip => ip,
        };
        let uri = format!("http://{}/", Address::new(&host.to_string(), local.port()));
        let (request_shutdown, shutdown_requested) = watch::channel(false);
        let api = Arc::new(Api::new(uri.clone(), request_shutdown));
        let server =
            Server::start(listener, move |method, arguments| api.answer(method, arguments));
        Ok(Self { uri, server: Mutex::new(Some(server)), shutdown_requested })
    }

    /// URI to pass as [`NodeOptions::master_uri`](crate::NodeOptions::master_uri), in the form
    /// `http://HOST:PORT/`. If the master listens on all addresses, HOST is the loopback address.
    pub fn uri(&self) -> &str {
        &self.uri
    }

    /// Waits until a peer calls the master's `shutdown` method. The master itself keeps running
    /// until [`Master::shutdown`] is called.
    pub async fn shutdown_requested(&self) {
        let mut requested = self.shutdown_requested.clone();
        // An error means that the server has stopped, so no shutdown request can arrive any more.
        let _ = requested.wait_for(|requested| *requested).await;
    }

    /// Stops the master. Its port is free when this function returns. A second call does nothing.
    pub async fn shutdown(&self) {
        if let Some(mut server) = self.server.lock().await.take() {
            server.stop().await;
        }
    }
}
