//! A service that the node provides, and the connections of its clients.

use std::{fmt, io, sync::Arc, time::Duration};

use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    sync::watch,
    time::timeout,
};

use crate::{
    message_type::ServiceType,
    tcpros::{Header, HeaderError, read_message_body, type_mismatch, write_message},
};

/// Longest time between the header exchange and the length of a non-persistent client's request. A
/// persistent client can be silent for any time before each call.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest time to receive the body of a request; the same limit applies to sending the response.
const TRANSFER_TIMEOUT: Duration = Duration::from_mins(1);

/// Computes the body of a response from the body of a request, or returns the error message for
/// the caller.
type Handler = dyn Fn(&[u8]) -> Result<Vec<u8>, String> + Send + Sync;

pub(crate) struct Provider {
    /// Full name of the service.
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

    /// Closes every connection of the service. A call in progress is answered first.
    pub(crate) fn close(&self) {
        self.closed.send_replace(true);
    }

    /// Answers the calls of one client, whose connection header has already been read.
    pub(crate) async fn serve(
        self: Arc<Self>,
        mut stream: TcpStream,
        header: &Header,
        node: &str,
    ) -> Result<(), HeaderError> {
        let ours = self.service_type;
        let what = format!("service [{}]", self.name);
        // Compare only the MD5 sum: some clients send the service's type, others the request's type
        // or none.
        if let Some(mismatch) = type_mismatch(header, &what, "*", ours.md5) {
            tracing::warn!(client = header.get("callerid"), "refused: {mismatch}");
            stream
                .write_all(&Header::new().with("error", &mismatch).encode()?)
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
            let (flag, body) = match self.run_handler(request).await {
                Ok(response) => (1, response),
                Err(reason) => (0, reason.into_bytes()),
            };
            let sent = async {
                stream.write_all(&[flag]).await?;
                write_message(&mut stream, &body).await
            };
            timeout(TRANSFER_TIMEOUT, sent)
                .await
                .map_err(io::Error::from)??;
            if !persistent {
                return Ok(stream.shutdown().await?);
            }
        }
    }

    /// Runs the handler on the thread pool for blocking work, because a handler can block.
    async fn run_handler(self: &Arc<Self>, request: Vec<u8>) -> Result<Vec<u8>, String> {
        let provider = Arc::clone(self);
        match tokio::task::spawn_blocking(move || (provider.handler)(&request)).await {
            Ok(outcome) => outcome,
            Err(error) => {
                tracing::error!(service = self.name, %error, "the service's handler failed");
                Err("the service's handler failed; see the log of its node".to_owned())
            }
        }
    }
}

async fn read_request(stream: &mut TcpStream, persistent: bool) -> io::Result<Vec<u8>> {
    let length = if persistent {
        stream.read_u32_le().await?
    } else {
        timeout(REQUEST_TIMEOUT, stream.read_u32_le()).await??
    };
    timeout(TRANSFER_TIMEOUT, read_message_body(stream, length)).await?
}
