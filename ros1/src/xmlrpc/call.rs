//! One call to an XML-RPC server.

use std::{io, time::Duration};

use tokio::{
    io::{AsyncWriteExt as _, BufReader},
    net::TcpStream,
    time::timeout,
};

use super::{
    decode::{DecodeError, decode_response},
    encode::encode_call,
    value::{Fault, Value},
};
use crate::{
    address::{Address, AddressError},
    http::{HttpError, read_body, read_head},
};

/// From the connection to the last byte of the answer. A master answers in milliseconds; a
/// registration must be repeated within 2 s after its restart, so a hung one may not hold us long.
const CALL_LIMIT: Duration = Duration::from_secs(3);

/// Why a call has no value.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// The URI has no host and port that can be called.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// Nobody there, or the connection broke.
    #[error("{uri} cannot be reached: {source}; is it running, and is its address right?")]
    Io {
        /// Who was called.
        uri: String,
        /// What the system said.
        source: io::Error,
    },
    /// No whole answer in time.
    #[error("{uri} did not answer {method} within {CALL_LIMIT:?}")]
    Timeout {
        /// Who was called.
        uri: String,
        /// What was asked.
        method: String,
    },
    /// The answer is not HTTP, or not `200`.
    #[error("{uri} answered with broken HTTP: {source}")]
    Http {
        /// Who was called.
        uri: String,
        /// What is wrong.
        source: HttpError,
    },
    /// The HTTP status is not 200.
    #[error("{uri} answered {status:?}; is it an XML-RPC server?")]
    Status {
        /// Who was called.
        uri: String,
        /// The first line of the answer.
        status: String,
    },
    /// The answer is not XML-RPC.
    #[error("{uri} answered {method} with something that is not XML-RPC: {source}")]
    Decode {
        /// Who was called.
        uri: String,
        /// What was asked.
        method: String,
        /// What is wrong.
        source: DecodeError,
    },
    /// The other side could not carry the call out at all.
    #[error("{uri} could not carry out {method}: {fault}")]
    Fault {
        /// Who was called.
        uri: String,
        /// What was asked.
        method: String,
        /// Its words.
        fault: Fault,
    },
    /// ROS status other than 1.
    #[error("{method} was refused with code {code}: {message}")]
    Refused {
        /// What was asked.
        method: String,
        /// 0: tried and failed; -1: the caller's mistake.
        code: i32,
        /// The other side's words.
        message: String,
    },
    /// Not the triple (code, message, value) of the ROS convention.
    #[error("{uri} answered {method} without the ROS triple (code, message, value)")]
    Shape {
        /// Who was called.
        uri: String,
        /// What was asked.
        method: String,
    },
}

/// Calls `method` at `uri`. Directly: no proxy variable of the environment is ever obeyed.
///
/// # Errors
/// Everything but a value, see [`CallError`].
pub async fn call(uri: &str, method: &str, arguments: &[Value]) -> Result<Value, CallError> {
    let address = Address::parse(uri)?;
    let body = encode_call(method, arguments);
    let exchange = exchange(&address, &body);
    let (status, answer) = match timeout(CALL_LIMIT, exchange).await {
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

/// Calls `method` at `uri` and unpacks the ROS triple (code, message, value).
///
/// # Errors
/// As [`call`], and [`CallError::Refused`] for every code other than 1.
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
        // An interim answer such as 100 Continue is followed by the real one.
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
