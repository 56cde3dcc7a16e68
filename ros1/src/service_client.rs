//! Calls to services of other nodes.

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
        HANDSHAKE_LIMIT, Header, HeaderError, disagreement, read_block, set_options, write_block,
    },
    xmlrpc::{CallError, Value, call_ros},
};

/// Why a service gave no response.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// The name is not a ROS name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The master does not know the service, or cannot be asked.
    #[error("service {service} cannot be looked up: {source}")]
    Lookup {
        /// The full name.
        service: String,
        /// The master's answer.
        source: CallError,
    },
    /// The master gave an address that is none.
    #[error("service {service} has no usable address: {source}")]
    Address {
        /// The full name.
        service: String,
        /// What the master gave.
        source: AddressError,
    },
    /// The provider is not there, or went away during the call.
    #[error("service {service} cannot be reached: {source}; is its node running?")]
    Io {
        /// The full name.
        service: String,
        /// What the system said.
        source: io::Error,
    },
    /// The provider's header is none.
    #[error("service {service} answered without a proper header: {source}")]
    Header {
        /// The full name.
        service: String,
        /// What is wrong.
        source: HeaderError,
    },
    /// The provider has another definition of the service, or refuses the client.
    #[error("service {service} refuses: {reason}")]
    Refused {
        /// The full name.
        service: String,
        /// Its words or ours.
        reason: String,
    },
    /// The provider tried and failed.
    #[error("service {service} failed: {reason}")]
    Failed {
        /// The full name.
        service: String,
        /// Its words.
        reason: String,
    },
}

/// A lasting connection to one service.
#[derive(Debug)]
pub struct ServiceClient {
    service: String,
    stream: TcpStream,
}

impl ServiceClient {
    /// Looks `service` (a full name) up and connects. `persistent`: for more than one call.
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
        match timeout(HANDSHAKE_LIMIT, shake_hands(&address, &header)).await {
            Ok(Ok((stream, answer))) => {
                let what = format!("service [{service}]");
                let refusal = match answer.get("error") {
                    Some(error) => Some(error.to_owned()),
                    None => disagreement(&answer, &what, "*", service_type.md5),
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

    /// Sends a request's body and waits for the response's, for as long as the provider
    /// computes; wrap it in a time-out where that matters, and drop the client when it strikes.
    ///
    /// # Errors
    /// [`ServiceError::Failed`] with the provider's words; [`ServiceError::Io`] when the
    /// connection broke, after which a new client is needed.
    pub async fn call(&mut self, request: &[u8]) -> Result<Vec<u8>, ServiceError> {
        match self.exchange(request).await {
            Ok((1, response)) => Ok(response),
            Ok((_, words)) => Err(ServiceError::Failed {
                service: self.service.clone(),
                reason: String::from_utf8_lossy(&words).into_owned(),
            }),
            Err(source) => Err(ServiceError::Io {
                service: self.service.clone(),
                source,
            }),
        }
    }

    async fn exchange(&mut self, request: &[u8]) -> io::Result<(u8, Vec<u8>)> {
        write_block(&mut self.stream, request).await?;
        let flag = self.stream.read_u8().await?;
        Ok((flag, read_block(&mut self.stream).await?))
    }
}

async fn shake_hands(
    address: &Address,
    header: &Header,
) -> Result<(TcpStream, Header), HeaderError> {
    let mut stream = TcpStream::connect((address.host(), address.port())).await?;
    set_options(&stream)?;
    stream.write_all(&header.encode()?).await?;
    let answer = Header::read(&mut stream).await?;
    Ok((stream, answer))
}
