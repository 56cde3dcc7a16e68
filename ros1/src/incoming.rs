//! TCPROS connections coming in: subscribers of our topics and clients of our services.

use std::{sync::Arc, time::Duration};

use tokio::{
    io::AsyncWriteExt as _,
    net::{TcpListener, TcpStream},
    sync::watch,
    task::JoinSet,
    time::{sleep, timeout},
};

use crate::{
    lock::lock,
    registrar::Registrar,
    tcpros::{Header, HeaderError, set_options},
};

/// Connections at once, those that have not sent their header included.
const MAX_CONNECTIONS: usize = 1024;
/// After a failed accept, such as out of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// What is queued when the node shuts down has this long to go out.
const DRAIN_LIMIT: Duration = Duration::from_millis(500);

/// Accepts until `stopped`, then lets the queues run dry.
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
                        if let Err(error) = welcome(stream, &registrar).await {
                            tracing::debug!(%peer, %error, "a TCPROS connection ended");
                        }
                    });
                }
                Err(error) => {
                    tracing::warn!(%error, "a TCPROS connection could not be accepted");
                    sleep(ACCEPT_PAUSE).await;
                }
            },
        }
    }
    drop(listener);
    let drained = async { while connections.join_next().await.is_some() {} };
    if timeout(DRAIN_LIMIT, drained).await.is_err() {
        tracing::debug!("some connections were cut with messages still queued");
    }
    connections.shutdown().await;
}

/// Reads the header and hands the connection to what it names.
async fn welcome(mut stream: TcpStream, registrar: &Registrar) -> Result<(), HeaderError> {
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
        let topic = lock(&registrar.graph).publishers.get(name).cloned();
        match topic {
            Some(topic) => return topic.serve(stream, &header, node).await,
            None => format!("{node} does not publish topic [{name}]"),
        }
    } else {
        "the header names neither a topic nor a service".to_owned()
    };
    stream
        .write_all(&Header::new().with("error", &reason).encode()?)
        .await?;
    Ok(stream.shutdown().await?)
}
