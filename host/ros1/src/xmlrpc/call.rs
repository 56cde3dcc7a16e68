//! The XML-RPC client. Each call opens a connection and closes it afterwards.

use std::{io, time::Duration};

use tokio::{
    io::{AsyncWriteExt as _, BufReader},
    net::TcpStream,
    time::timeout,
};

use super::{
    codec::{DecodeError, decode_response, encode_call},
    value::{Fault, Value},
};
use crate::{
    address::{Address, AddressError},
    http::{HttpError, read_body, read_head},
};

/// Longest time from connecting to the last byte of the answer. A working master answers in
/// milliseconds. The limit is short, because a call that hangs delays the node's next registration.
const CALL_TIMEOUT: Duration = Duration::from_secs(3);

/// Why an XML-RPC call returned no value.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// The URI to call is malformed.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// The connection to the server was refused, or it broke.
    #[error("{uri} cannot be reached: {source}; is it running, and is its address right?")]
    Io {
        /// XML-RPC URI that was called.
        uri: String,
        /// Error from the operating system.
        source: io::Error,
    },
    /// The answer was not complete within 3 s.
    #[error("{uri} did not answer {method} within {} s", CALL_TIMEOUT.as_secs())]
    Timeout {
        /// XML-RPC URI that was called.
        uri: String,
        /// XML-RPC method, such as `registerPublisher`.
        method: String,
    },
    /// The answer is not valid HTTP.
    #[error("{uri} answered with broken HTTP: {source}")]
    Http {
        /// XML-RPC URI that was called.
        uri: String,
        /// First violation of HTTP in the answer.
        source: HttpError,
    },
    /// The HTTP status is not 200.
    #[error("{uri} answered '{}'; is it an XML-RPC server?", status.escape_debug())]
    Status {
        /// XML-RPC URI that was called.
        uri: String,
        /// Status line of the answer.
        status: String,
    },
    /// The answer is not XML-RPC.
    #[error("{uri} answered {method} with something that is not XML-RPC: {source}")]
    Decode {
        /// XML-RPC URI that was called.
        uri: String,
        /// XML-RPC method, such as `registerPublisher`.
        method: String,
        /// First violation of XML-RPC's grammar in the answer.
        source: DecodeError,
    },
    /// The server returned a fault: it could not carry out the call at all.
    #[error("{uri} could not carry out {method}: {fault}")]
    Fault {
        /// XML-RPC URI that was called.
        uri: String,
        /// XML-RPC method, such as `registerPublisher`.
        method: String,
        /// Error code and message returned by the server.
        fault: Fault,
    },
    /// The server returned a ROS status code other than 1.
    #[error("{method} was refused with code {code}: {message}")]
    Refused {
        /// XML-RPC method, such as `registerPublisher`.
        method: String,
        /// ROS status code: 0 for a failure, -1 for an error of the caller.
        code: i32,
        /// Error message from the server.
        message: String,
    },
    /// The answer is not the triple (code, message, value) of a ROS API.
    #[error("{uri} answered {method} without the ROS triple (code, message, value)")]
    Shape {
        /// XML-RPC URI that was called.
        uri: String,
        /// XML-RPC method, such as `registerPublisher`.
        method: String,
    },
}

/// Calls `method` at `uri` and returns the value of the answer. Connects directly: proxy settings
/// in environment variables are ignored.
///
/// # Errors
/// All variants of [`CallError`] except `Refused` and `Shape`.
pub async fn call(uri: &str, method: &str, arguments: &[Value]) -> Result<Value, CallError> {
    let address = Address::parse(uri)?;
    let body = encode_call(method, arguments);
    let exchange = exchange(&address, &body);
    let (status, answer) = match timeout(CALL_TIMEOUT, exchange).await {
        Ok(Ok(answer)) => answer,
        Ok(Err(HttpError::Io(source))) => {
            return Err(CallError::Io {
                uri: uri.to_owned(),
                source,
            });
        }
        Ok(Err(source)) => {
            return Err(CallError::Http {
                uri: uri.to_owned(),
                source,
            });
        }
        Err(_) => {
            return Err(CallError::Timeout {
                uri: uri.to_owned(),
                method: method.to_owned(),
            });
        }
    };
    if status.split_ascii_whitespace().nth(1) != Some("200") {
        return Err(CallError::Status {
            uri: uri.to_owned(),
            status,
        });
    }
    match decode_response(&answer) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(fault)) => Err(CallError::Fault {
            uri: uri.to_owned(),
            method: method.to_owned(),
            fault,
        }),
        Err(source) => Err(CallError::Decode {
            uri: uri.to_owned(),
            method: method.to_owned(),
            source,
        }),
    }
}

/// Calls `method` of a ROS API at `uri`. Returns the third item of the answer (code, message,
/// value).
///
/// # Errors
/// All variants of [`CallError`]. A status code other than 1 becomes [`CallError::Refused`].
pub async fn call_ros(uri: &str, method: &str, arguments: &[Value]) -> Result<Value, CallError> {
    let triple = call(uri, method, arguments).await?;
    if let Value::Array(items) = triple
        && let Ok([code, message, value]) = <[Value; 3]>::try_from(items)
        && let Some(code) = code.as_int()
    {
        return if code == 1 {
            Ok(value)
        } else {
            Err(CallError::Refused {
                method: method.to_owned(),
                code,
                message: message.as_str().unwrap_or_default().to_owned(),
            })
        };
    }
    Err(CallError::Shape {
        uri: uri.to_owned(),
        method: method.to_owned(),
    })
}

async fn exchange(address: &Address, body: &str) -> Result<(String, Vec<u8>), HttpError> {
    let stream = TcpStream::connect((address.host(), address.port())).await?;
    stream.set_nodelay(true)?;
    let mut stream = BufReader::new(stream);
    let request = format!(
        "POST / HTTP/1.1\r\nHost: {address}\r\nUser-Agent: ros1\r\nContent-Type: text/xml\r\n\
         Content-Length: {}\r\nConnection: close\r\n\r\n{body}",
        body.len()
    );
    stream.get_mut().write_all(request.as_bytes()).await?;
    loop {
        let head = read_head(&mut stream).await?.ok_or(HttpError::Truncated)?;
        // Skip interim HTTP answers such as `100 Continue`.
        if head
            .first_line
            .split_ascii_whitespace()
            .nth(1)
            .is_some_and(|s| s.starts_with('1'))
        {
            continue;
        }
        let answer = read_body(&mut stream, &head).await?;
        return Ok((head.first_line, answer));
    }
}
