//! Host and port out of a URI.

use std::fmt;

/// Why a URI cannot be called.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{uri:?} is not SCHEME://HOST:PORT; an example is http://127.0.0.1:11311/")]
pub struct AddressError {
    /// What was given.
    pub uri: String,
}

/// Where a peer listens. An IPv6 address stands in brackets in a URI and without them here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Address {
    host: String,
    port: u16,
}

impl Address {
    /// Reads `http://HOST:PORT/`, `rosrpc://HOST:PORT` and the like.
    pub(crate) fn parse(uri: &str) -> Result<Self, AddressError> {
        let error = || AddressError {
            uri: uri.to_owned(),
        };
        let (_, rest) = uri.split_once("://").ok_or_else(error)?;
        let authority = rest.split('/').next().unwrap_or_default();
        let (host, port) = authority.rsplit_once(':').ok_or_else(error)?;
        let host = match host.strip_prefix('[') {
            Some(inner) => inner.strip_suffix(']').ok_or_else(error)?,
            None => host,
        };
        if host.is_empty() {
            return Err(error());
        }
        Ok(Self {
            host: host.to_owned(),
            port: port.parse().map_err(|_| error())?,
        })
    }

    pub(crate) fn new(host: &str, port: u16) -> Self {
        Self {
            host: host
                .trim_start_matches('[')
                .trim_end_matches(']')
                .to_owned(),
            port,
        }
    }

    pub(crate) fn host(&self) -> &str {
        &self.host
    }

    pub(crate) fn port(&self) -> u16 {
        self.port
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.host.contains(':') {
            write!(f, "[{}]:{}", self.host, self.port)
        } else {
            write!(f, "{}:{}", self.host, self.port)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ipv4_ipv6_and_names_are_read_and_written_back() {
        for (uri, host, port, text) in [
            (
                "http://127.0.0.1:11311/",
                "127.0.0.1",
                11311,
                "127.0.0.1:11311",
            ),
            ("http://[::1]:11311", "::1", 11311, "[::1]:11311"),
            ("rosrpc://robot:40001", "robot", 40001, "robot:40001"),
        ] {
            let address = Address::parse(uri).unwrap();
            assert_eq!((address.host(), address.port()), (host, port));
            assert_eq!(address.to_string(), text);
        }
    }

    #[test]
    fn what_is_no_uri_is_refused() {
        for uri in [
            "",
            "127.0.0.1:1",
            "http://host/",
            "http://host:port/",
            "http://:1/",
        ] {
            assert_eq!(
                Address::parse(uri),
                Err(AddressError {
                    uri: uri.to_owned()
                })
            );
        }
    }
}
