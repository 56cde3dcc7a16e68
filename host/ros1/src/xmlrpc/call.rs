//! The XML-RPC client. Each call opens a connection and closes it afterwards.

use std::{io, time::Duration};

use tokio::{
    io::{AsyncWriteExt as _, BufReader},
    time::timeout,
};

use super::{
    codec::{DecodeError, decode_response, encode_call},
    value::{Fault, Value},
};
use crate::{
    address::{Address, AddressError, ConnectError, LookupError},
    http::{HttpError, read_body, read_head},
};

/// Time limit for a call, from connecting to the last byte of the response. Masters respond in
/// milliseconds. The limit is short, because a call that hangs delays the node's next registration.
const CALL_TIMEOUT: Duration = Duration::from_secs(3);

/// Why an XML-RPC call returned no value.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// The URI to call is malformed.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// The server did not return the result of the method.
    #[error("{method} failed: {uri} {failure}")]
    Failed {
        /// XML-RPC URI that was called.
        uri: String,
        /// XML-RPC method, such as `registerPublisher`.
        method: String,
        /// What the server did instead of returning the method's result.
        #[source]
        failure: CallFailure,
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
}

/// What a server did instead of returning the result of an XML-RPC method. Each error message
/// continues a sentence that starts with the server's URI.
#[derive(Debug, thiserror::Error)]
pub enum CallFailure {
    /// The name of the server's host has no address.
    #[error("cannot be reached: {0}")]
    Lookup(#[from] LookupError),
    /// The connection to the server was refused, or it broke.
    #[error("cannot be reached: {0}; is it running, and is its address right?")]
    Io(#[from] io::Error),
    /// The response was not complete within 3 s.
    #[error("did not answer within {} s", CALL_TIMEOUT.as_secs())]
    Timeout,
    /// The response is not valid HTTP.
    #[error("answered with broken HTTP: {0}")]
    Http(#[source] HttpError),
    /// The HTTP status is not 200; holds the status line.
    #[error("answered '{}'; is it an XML-RPC server?", .0.escape_debug())]
    Status(String),
    /// The response is not XML-RPC.
    #[error("answered with something that is not XML-RPC: {0}")]
    Decode(#[from] DecodeError),
    /// The server returned a fault: it could not carry out the call at all.
    #[error("answered with the {0}")]
    Fault(#[from] Fault),
    /// The response is valid XML-RPC, but not the triple (code, message, value) of a ROS API.
    #[error("answered without the ROS triple (code, message, value)")]
    Shape,
}

impl From<ConnectError> for CallFailure {
    fn from(error: ConnectError) -> Self {
        match error {
            ConnectError::Lookup(error) => Self::Lookup(error),
            ConnectError::Io(source) => Self::Io(source),
        }
    }
}

impl From<HttpError> for CallFailure {
    fn from(error: HttpError) -> Self {
        match error {
            HttpError::Io(source) => Self::Io(source),
            error => Self::Http(error),
        }
    }
}

impl CallFailure {
    /// Turns this failure into the error of a call of `method` at `uri`.
    pub(crate) fn of(self, uri: &str, method: &str) -> CallError {
        CallError::Failed { uri: uri.to_owned(), method: method.to_owned(), failure: self }
    }
}

/// Calls `method` at `uri` and returns the value in the response. Connects directly: proxy settings
/// in environment variables are ignored.
///
/// # Errors
/// [`CallError::Address`], or [`CallError::Failed`] with any failure but [`CallFailure::Shape`].
pub async fn call(uri: &str, method: &str, arguments: &[Value]) -> Result<Value, CallError> {
    let address = Address::parse(uri)?;
    let body = encode_call(method, arguments);
    let outcome = timeout(CALL_TIMEOUT, exchange(&address, &body)).await;
    let outcome = outcome.unwrap_or(Err(CallFailure::Timeout));
    outcome.map_err(|failure| failure.of(uri, method))
}

/// Calls `method` of a ROS API at `uri` and returns the value in the response (code, message,
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
    Err(CallFailure::Shape.of(uri, method))
}

async fn exchange(address: &Address, body: &str) -> Result<Value, CallFailure> {
    let stream = address.connect().await?;
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
        let status = head.first_line.split_ascii_whitespace().nth(1);
        // Skip interim HTTP responses such as `100 Continue`.
        if status.is_some_and(|status| status.starts_with('1')) {
            continue;
        }
        let answer = read_body(&mut stream, &head).await?;
        if status != Some("200") {
            return Err(CallFailure::Status(head.first_line));
        }
        return Ok(decode_response(&answer)??);
    }
}
