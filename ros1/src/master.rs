//! A ROS 1 master for demonstrations and tests. It answers as rosmaster does, word for word.

mod api;
mod arguments;
mod notifier;
mod parameter_api;
mod parameter_updates;
mod parameters;
mod registrations;
mod signature;

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

/// A running master. Dropping it ends it; only [`Master::shutdown`] waits until its port is free.
#[derive(Debug)]
pub struct Master {
    uri: String,
    server: Mutex<Option<Server>>,
    shutdown_requested: watch::Receiver<bool>,
}

impl Master {
    /// Listens at `address`; port 0 takes a free one.
    ///
    /// # Errors
    /// The address cannot be listened on: another master is there, or it is not this machine's.
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
        let server = Server::start(listener, move |method, arguments| {
            api.answer(method, arguments)
        });
        Ok(Self {
            uri,
            server: Mutex::new(Some(server)),
            shutdown_requested,
        })
    }

    /// `http://HOST:PORT/`: what nodes take as their master's URI. A master that listens on
    /// every address gives the loopback one here.
    pub fn uri(&self) -> &str {
        &self.uri
    }

    /// Waits until someone calls the master's `shutdown` method; then call [`Master::shutdown`].
    pub async fn shutdown_requested(&self) {
        let mut requested = self.shutdown_requested.clone();
        // The sender lives as long as the server; without one there is nothing to wait for.
        let _ = requested.wait_for(|requested| *requested).await;
    }

    /// Ends the master: when this returns, its port is free. A second call does nothing.
    pub async fn shutdown(&self) {
        if let Some(mut server) = self.server.lock().await.take() {
            server.stop().await;
        }
    }
}
