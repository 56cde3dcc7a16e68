//! Parses the host and the port of a peer's URI.

use std::fmt;

/// Error for a URI without a host and a port, to which no connection can be opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{uri} is not SCHEME://HOST:PORT; an example is http://127.0.0.1:11311/")]
pub struct AddressError {
    /// The URI as it was configured or received.
    pub uri: String,
}

/// Host and TCP port of a peer. An IPv6 address is stored without the square brackets that enclose
/// it in a URI.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Address {
    host: String,
    port: u16,
}

impl Address {
    /// Parses `SCHEME://HOST:PORT`, with or without a path, such as `http://HOST:PORT/` and
    /// `rosrpc://HOST:PORT`.
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
    fn ipv4_ipv6_and_host_names_survive_a_round_trip() {
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
    fn uris_without_host_and_port_are_refused() {
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
