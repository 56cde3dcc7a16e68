//! Calls services of other nodes.

use std::io;

use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    time::timeout,
};

use crate::{
    address::{Address, AddressError},
    message_type::ServiceType,
    names::NameError,
    tcpros::{
        HANDSHAKE_TIMEOUT, Header, HeaderError, read_message, set_options, type_mismatch,
        write_message,
    },
    xmlrpc::{CallError, Value, call_ros},
};

/// Why a service call failed.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The name is not a ROS name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The master does not know the service or does not answer.
    #[error("service {service} cannot be looked up: {source}")]
    Lookup {
        /// Full name of the service after remapping, such as `/lab/reset`.
        service: String,
        /// Error from the call of the master's `lookupService` method.
        source: CallError,
    },
    /// The master returned a malformed service URI.
    #[error("service {service} has no usable address: {source}")]
    Address {
        /// Full name of the service after remapping, such as `/lab/reset`.
        service: String,
        /// Error that holds the URI returned by the master.
        source: AddressError,
    },
    /// The connection to the provider could not be opened, or it broke during the call.
    #[error("service {service} cannot be reached: {source}; is its node running?")]
    Io {
        /// Full name of the service after remapping, such as `/lab/reset`.
        service: String,
        /// Error from the operating system.
        source: io::Error,
    },
    /// The provider's connection header is malformed or missing.
    #[error("service {service} answered without a valid header: {source}")]
    Header {
        /// Full name of the service after remapping, such as `/lab/reset`.
        service: String,
        /// Why the header was rejected.
        source: HeaderError,
    },
    /// The client and the provider have different definitions of the service, or the provider
    /// refused the client.
    #[error("service {service} refuses: {reason}")]
    Refused {
        /// Full name of the service after remapping, such as `/lab/reset`.
        service: String,
        /// Error message from the provider, or the difference between the two service types.
        reason: String,
    },
    /// The provider accepted the call, but its handler returned an error.
    #[error("service {service} failed: {reason}")]
    Failed {
        /// Full name of the service after remapping, such as `/lab/reset`.
        service: String,
        /// Error message from the provider's handler.
        reason: String,
    },
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
            Err(source) => return Err(ServiceError::Lookup { service, source }),
        };
        let address = match Address::parse(uri.as_str().unwrap_or_default()) {
            Ok(address) => address,
            Err(source) => return Err(ServiceError::Address { service, source }),
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
                    Some(reason) => Err(ServiceError::Refused { service, reason }),
                    None => Ok(Self { service, stream }),
                }
            }
            Ok(Err(HeaderError::Io(source))) => Err(ServiceError::Io { service, source }),
            Ok(Err(source)) => Err(ServiceError::Header { service, source }),
            Err(_) => Err(ServiceError::Io {
                service,
                source: io::ErrorKind::TimedOut.into(),
            }),
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
        match self.exchange(request).await {
            Ok((1, response)) => Ok(response),
            Ok((_, message)) => Err(ServiceError::Failed {
                service: self.service.clone(),
                reason: String::from_utf8_lossy(&message).into_owned(),
            }),
            Err(source) => Err(ServiceError::Io {
                service: self.service.clone(),
                source,
            }),
        }
    }

    async fn exchange(&mut self, request: &[u8]) -> io::Result<(u8, Vec<u8>)> {
        write_message(&mut self.stream, request).await?;
        let flag = self.stream.read_u8().await?;
        Ok((flag, read_message(&mut self.stream).await?))
    }
}

async fn handshake(address: &Address, header: &Header) -> Result<(TcpStream, Header), HeaderError> {
    let mut stream = TcpStream::connect((address.host(), address.port())).await?;
    set_options(&stream)?;
    stream.write_all(&header.encode()?).await?;
    let answer = Header::read(&mut stream).await?;
    Ok((stream, answer))
}
