//! Services that this node provides.

use std::{fmt, io, sync::Arc, time::Duration};

use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    sync::watch,
    time::timeout,
};

use crate::{
    graph::Lease,
    message_type::ServiceType,
    tcpros::{Header, HeaderError, disagreement, read_body, write_block},
};

/// A client for one call begins its request within this time after the headers. A persistent
/// client may wait as long as it likes before each call.
const REQUEST_LIMIT: Duration = Duration::from_secs(10);
/// A request that was begun is whole, and a response is taken, within this time.
const TRANSFER_LIMIT: Duration = Duration::from_mins(1);

/// A service that this node provides; it is withdrawn when this is dropped.
#[derive(Debug)]
#[must_use = "the service is withdrawn when this is dropped"]
pub struct Service {
    provider: Arc<Provider>,
    _lease: Lease,
}

impl Service {
    pub(crate) fn new(provider: Arc<Provider>, lease: Lease) -> Self {
        Self {
            provider,
            _lease: lease,
        }
    }

    /// The service's full name, remapped.
    pub fn name(&self) -> &str {
        &self.provider.name
    }
}

/// Turns a request's body into a response's, or into words for the caller why not.
type Handler = dyn Fn(&[u8]) -> Result<Vec<u8>, String> + Send + Sync;

/// One service of the node's.
pub(crate) struct Provider {
    pub(crate) name: String,
    service_type: &'static ServiceType,
    handler: Box<Handler>,
    closed: watch::Sender<bool>,
}

impl fmt::Debug for Provider {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Provider")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl Provider {
    pub(crate) fn new(
        name: String,
        service_type: &'static ServiceType,
        handler: Box<Handler>,
    ) -> Self {
        Self {
            name,
            service_type,
            handler,
            closed: watch::Sender::new(false),
        }
    }

    /// Ends persistent connections after the call they are in.
    pub(crate) fn close(&self) {
        self.closed.send_replace(true);
    }

    /// Serves one client, whose header has been read.
    pub(crate) async fn serve(
        self: Arc<Self>,
        mut stream: TcpStream,
        header: &Header,
        node: &str,
    ) -> Result<(), HeaderError> {
        let ours = self.service_type;
        let what = format!("service [{}]", self.name);
        // Clients write the type of the service, of the request, or none; the md5 decides.
        if let Some(difference) = disagreement(header, &what, "*", ours.md5) {
            tracing::warn!(client = header.get("callerid"), "refused: {difference}");
            stream
                .write_all(&Header::new().with("error", &difference).encode()?)
                .await?;
            return Ok(stream.shutdown().await?);
        }
        let answer = Header::new()
            .with("callerid", node)
            .with("md5sum", ours.md5)
            .with("request_type", &format!("{}Request", ours.name))
            .with("response_type", &format!("{}Response", ours.name))
            .with("service", &self.name)
            .with("type", ours.name)
            .encode()?;
        stream.write_all(&answer).await?;
        if header.get("probe") == Some("1") {
            return Ok(stream.shutdown().await?);
        }
        let persistent = header.get("persistent") == Some("1");
        let mut closed = self.closed.subscribe();
        loop {
            let request = tokio::select! {
                request = read_request(&mut stream, persistent) => match request {
                    Ok(request) => request,
                    Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(()),
                    Err(error) => return Err(error.into()),
                },
                () = async { let _ = closed.wait_for(|closed| *closed).await; } => return Ok(()),
            };
            let (flag, body) = match self.handle(request).await {
                Ok(response) => (1, response),
                Err(reason) => (0, reason.into_bytes()),
            };
            let sent = async {
                stream.write_all(&[flag]).await?;
                write_block(&mut stream, &body).await
            };
            timeout(TRANSFER_LIMIT, sent)
                .await
                .map_err(io::Error::from)??;
            if !persistent {
                return Ok(stream.shutdown().await?);
            }
        }
    }

    /// The handler may compute for long, so it runs where nothing else waits for it.
    async fn handle(self: &Arc<Self>, request: Vec<u8>) -> Result<Vec<u8>, String> {
        let provider = Arc::clone(self);
        match tokio::task::spawn_blocking(move || (provider.handler)(&request)).await {
            Ok(outcome) => outcome,
            Err(error) => {
                tracing::error!(service = self.name, %error, "the service's handler failed");
                Err("the service's handler failed; see the node's log".to_owned())
            }
        }
    }
}

async fn read_request(stream: &mut TcpStream, persistent: bool) -> io::Result<Vec<u8>> {
    let length = if persistent {
        stream.read_u32_le().await?
    } else {
        timeout(REQUEST_LIMIT, stream.read_u32_le()).await??
    };
    timeout(TRANSFER_LIMIT, read_body(stream, length)).await?
}
