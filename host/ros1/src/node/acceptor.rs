//! Accepts TCPROS connections from subscribers of this node's topics and from clients of its
//! services.

use std::{sync::Arc, time::Duration};

use tokio::{
    net::{TcpListener, TcpStream},
    sync::watch,
    task::JoinSet,
    time::{sleep, timeout},
};

use super::registrar::Registrar;
use crate::{
    sync::lock,
    tcpros::{Header, HeaderError, refuse, set_options},
};

/// Maximum number of open connections, including those whose header has not been read yet.
const MAX_CONNECTIONS: usize = 1024;
/// Delay after a failed accept, for example when no file descriptor is left.
const ACCEPT_RETRY_DELAY: Duration = Duration::from_millis(100);
/// Time limit for sending queued messages after a shutdown has started.
const DRAIN_TIMEOUT: Duration = Duration::from_millis(500);

/// Accepts connections until `stopped` is set, then waits at most [`DRAIN_TIMEOUT`] until all
/// queued messages are sent.
pub(crate) async fn accept(
    listener: TcpListener,
    registrar: Arc<Registrar>,
    mut stopped: watch::Receiver<bool>,
) {
    let mut connections = JoinSet::new();
    loop {
        tokio::select! {
            () = async { let _ = stopped.wait_for(|stop| *stop).await; } => break,
            Some(_) = connections.join_next() => {}
            accepted = listener.accept(), if connections.len() < MAX_CONNECTIONS => match accepted {
                Ok((stream, peer)) => {
                    let registrar = Arc::clone(&registrar);
                    connections.spawn(async move {
                        if let Err(error) = serve_connection(stream, &registrar).await {
                            tracing::debug!(%peer, %error, "a TCPROS connection ended");
                        }
                    });
                }
                Err(error) => {
                    tracing::warn!(%error, "a TCPROS connection could not be accepted");
                    sleep(ACCEPT_RETRY_DELAY).await;
                }
            },
        }
    }
    drop(listener);
    let drained = async { while connections.join_next().await.is_some() {} };
    if timeout(DRAIN_TIMEOUT, drained).await.is_err() {
        tracing::debug!("some connections were closed with messages still queued");
    }
    connections.shutdown().await;
}

/// Reads the header of a connection and passes the connection to the topic or service in the
/// header.
async fn serve_connection(mut stream: TcpStream, registrar: &Registrar) -> Result<(), HeaderError> {
    set_options(&stream)?;
    let header = Header::read(&mut stream).await?;
    let node = &registrar.node;
    let reason = if let Some(name) = header.get("service") {
        let provider = lock(&registrar.graph).services.get(name).cloned();
        match provider {
            Some(provider) => return provider.serve(stream, &header, node).await,
            None => format!("{node} does not provide service [{name}]"),
        }
    } else if let Some(name) = header.get("topic") {
        let publication = lock(&registrar.graph).publications.get(name).cloned();
        match publication {
            Some(publication) => return publication.serve(stream, &header, node).await,
            None => format!("{node} does not publish topic [{name}]"),
        }
    } else {
        "the header names neither a topic nor a service".to_owned()
    };
    refuse(stream, &reason).await
}
