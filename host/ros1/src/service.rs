//! The network side of services: the provider and the client.

use std::{fmt, io, sync::Arc, time::Duration};

use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    sync::watch,
    time::timeout,
};

use crate::{
    address::{Address, AddressError, ConnectError},
    names::NameError,
    tcpros::{
        HANDSHAKE_TIMEOUT, Header, HeaderError, ServiceType, read_message, read_message_body,
        refuse, set_options, type_mismatch, write_message,
    },
    xmlrpc::{CallError, Value, call_ros},
};

/// Time limit for a non-persistent client to send its request's length after the header exchange. A
/// persistent client can be silent for any time before each call.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest time to receive the body of a request; the same limit applies to sending the response.
const TRANSFER_TIMEOUT: Duration = Duration::from_mins(1);

/// Computes the body of a response from the name of the calling node and the body of its request,
/// or returns the error message for the caller.
type Handler = dyn Fn(&str, &[u8]) -> Result<Vec<u8>, String> + Send + Sync;

pub(crate) struct Provider {
    /// Full name of the service.
    pub(crate) name: String,
    service_type: &'static ServiceType,
    handler: Box<Handler>,
    closed: watch::Sender<bool>,
}

impl fmt::Debug for Provider {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Provider").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Provider {
    pub(crate) fn new(
        name: String,
        service_type: &'static ServiceType,
        handler: Box<Handler>,
    ) -> Self {
        Self { name, service_type, handler, closed: watch::Sender::new(false) }
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
        // Compare only the MD5 sum: clients send the service's type, the request's type or none.
        if let Some(mismatch) = type_mismatch(header, &what, "*", ours.md5) {
            tracing::warn!(client = header.get("callerid"), "refused: {mismatch}");
            return refuse(stream, &mismatch).await;
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
        let caller = header.get("callerid").unwrap_or("unknown");
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
            let (flag, body) = match self.run_handler(caller, request).await {
                Ok(response) => (1, response),
                Err(reason) => (0, reason.into_bytes()),
            };
            let sent = async {
                stream.write_all(&[flag]).await?;
                write_message(&mut stream, &body).await
            };
            timeout(TRANSFER_TIMEOUT, sent).await.map_err(io::Error::from)??;
            if !persistent {
                return Ok(stream.shutdown().await?);
            }
        }
    }

    /// Runs the handler on the thread pool for blocking work, because a handler can block.
    async fn run_handler(
        self: &Arc<Self>,
        caller: &str,
        request: Vec<u8>,
    ) -> Result<Vec<u8>, String> {
        let (provider, caller) = (Arc::clone(self), caller.to_owned());
        let handled = tokio::task::spawn_blocking(move || (provider.handler)(&caller, &request));
        match handled.await {
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

/// Why a service call failed. All variants but [`ServiceError::Name`] hold the full name of the
/// service after remapping, such as `/lab/reset`, and the reason.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The name is not a ROS name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The master does not know the service or does not answer.
    #[error("service {0} cannot be looked up: {1}")]
    Lookup(String, #[source] CallError),
    /// The master returned a malformed service URI.
    #[error("service {0} has no usable address: {1}")]
    Address(String, #[source] AddressError),
    /// The connection to the provider could not be opened, or it broke during the call.
    #[error("service {0} cannot be reached: {1}; is its node running?")]
    Io(String, #[source] io::Error),
    /// The provider's connection header is malformed or missing.
    #[error("service {0} answered without a valid header: {1}")]
    Header(String, #[source] HeaderError),
    /// The client and the provider have different definitions of the service, or the provider
    /// refused the client. The reason is the provider's error message, or the difference between
    /// the two service types.
    #[error("service {0} refuses: {1}")]
    Refused(String, String),
    /// The provider accepted the call, but its handler returned this error message.
    #[error("service {0} failed: {1}")]
    Failed(String, String),
}

/// A connection to the provider of one service.
#[derive(Debug)]
pub struct ServiceClient {
    service: String,
    stream: TcpStream,
}

impl ServiceClient {
    /// Looks up `service`, which must be a full name, and connects to its provider. Unless
    /// `persistent`, the provider closes the connection after one call.
    pub(crate) async fn connect(
        node: &str,
        master_uri: &str,
        service: &str,
        service_type: &ServiceType,
        persistent: bool,
    ) -> Result<Self, ServiceError> {
        let service = service.to_owned();
        let arguments = [Value::from(node), service.as_str().into()];
        let uri = match call_ros(master_uri, "lookupService", &arguments).await {
            Ok(uri) => uri,
            Err(error) => return Err(ServiceError::Lookup(service, error)),
        };
        let address = match Address::parse(uri.as_str().unwrap_or_default()) {
            Ok(address) => address,
            Err(error) => return Err(ServiceError::Address(service, error)),
        };
        let header = Header::new()
            .with("callerid", node)
            .with("md5sum", service_type.md5)
            .with("persistent", if persistent { "1" } else { "0" })
            .with("service", &service)
            .with("type", service_type.name);
        match timeout(HANDSHAKE_TIMEOUT, handshake(&address, &header)).await {
            Ok(Ok((stream, answer))) => {
                let what = format!("service [{service}]");
                let refusal = match answer.get("error") {
                    Some(error) => Some(error.to_owned()),
                    None => type_mismatch(&answer, &what, "*", service_type.md5),
                };
                match refusal {
                    Some(reason) => Err(ServiceError::Refused(service, reason)),
                    None => Ok(Self { service, stream }),
                }
            }
            Ok(Err(HeaderError::Io(error))) => Err(ServiceError::Io(service, error)),
            Ok(Err(error)) => Err(ServiceError::Header(service, error)),
            Err(_) => Err(ServiceError::Io(service, io::ErrorKind::TimedOut.into())),
        }
    }

    /// Sends the body of a request and returns the body of the response. The call has no time
    /// limit. To limit the time, wrap the call in a timeout, and drop the client if the timeout
    /// expires.
    ///
    /// # Errors
    /// [`ServiceError::Failed`] with the provider's error message; [`ServiceError::Io`] if the
    /// connection broke, in which case a new client must be connected.
    pub async fn call(&mut self, request: &[u8]) -> Result<Vec<u8>, ServiceError> {
        let service = self.service.clone();
        match self.exchange(request).await {
            Ok((1, response)) => Ok(response),
            Ok((_, message)) => {
                let message = String::from_utf8_lossy(&message).into_owned();
                Err(ServiceError::Failed(service, message))
            }
            Err(error) => Err(ServiceError::Io(service, error)),
        }
    }

    async fn exchange(&mut self, request: &[u8]) -> io::Result<(u8, Vec<u8>)> {
        write_message(&mut self.stream, request).await?;
        let flag = self.stream.read_u8().await?;
        Ok((flag, read_message(&mut self.stream).await?))
    }
}

async fn handshake(address: &Address, header: &Header) -> Result<(TcpStream, Header), HeaderError> {
    let mut stream = address.connect().await.map_err(|error| match error {
        ConnectError::Lookup(error) => io::Error::new(io::ErrorKind::NotFound, error),
        ConnectError::Io(error) => error,
    })?;
    set_options(&stream)?;
    stream.write_all(&header.encode()?).await?;
    let answer = Header::read(&mut stream).await?;
    Ok((stream, answer))
}
