//! Address of the device: serial port, pseudoterminal, TCP server, or `auto`.

use std::fmt;
use std::io;
use std::path::PathBuf;
use std::str::FromStr;

/// Address of the device, parsed from `--port`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PortAddress {
    /// Path of a serial port or a pseudoterminal.
    Tty(PathBuf),
    /// Host and port of a TCP server, written `tcp:HOST:PORT`.
    Tcp(String),
    /// The serial port that a board has now, written `auto`: of the only board, or of the one whose
    /// serial number follows, `auto:SERIAL`.
    Auto(Option<String>),
}

impl FromStr for PortAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<PortAddress, String> {
        match text.split_once(':') {
            Some(("tcp", address)) => {
                let port = address
                    .rsplit_once(':')
                    .map(|(host, port)| (host, port.parse::<u16>()));
                match port {
                    Some((host, Ok(_))) if !host.is_empty() => {
                        Ok(PortAddress::Tcp(address.to_owned()))
                    }
                    _ => Err(format!(
                        "`{address}` is not a host and a port of 0 to 65535; write tcp:127.0.0.1:5555"
                    )),
                }
            }
            // host-sim prints its pseudoterminals as `pty:PATH`.
            Some(("pty", path)) if !path.is_empty() => Ok(PortAddress::Tty(path.into())),
            Some(("auto", "")) => Err(
                "the serial number is missing; write auto:SERIAL, as listed by corticode-bridge ports"
                    .to_owned(),
            ),
            Some(("auto", serial)) => Ok(PortAddress::Auto(Some(serial.to_owned()))),
            None if text == "auto" => Ok(PortAddress::Auto(None)),
            _ if text.is_empty() => Err("the path is empty; write /dev/ttyACM0".to_owned()),
            _ if is_tcp_without_prefix(text) => Err(format!(
                "`{text}` is not the path of a port; write tcp:HOST:PORT, such as tcp:127.0.0.1:5555, \
                 or ./{text} for a file of this name"
            )),
            _ => Ok(PortAddress::Tty(text.into())),
        }
    }
}

/// Returns whether a text is a number, or ends with a colon and a number, and has no folder: what remains
/// of `tcp:HOST:PORT` without its beginning.
fn is_tcp_without_prefix(text: &str) -> bool {
    let last = text.rsplit(':').next().unwrap_or(text);
    !text.contains('/') && !last.is_empty() && last.bytes().all(|byte| byte.is_ascii_digit())
}

impl PortAddress {
    /// Parses the address of a port to make: `pty:PATH` or `tcp:HOST:PORT`.
    ///
    /// # Errors
    ///
    /// What is allowed, for any other text.
    pub(crate) fn parse_output(text: &str) -> Result<PortAddress, String> {
        match text.split_once(':') {
            Some(("pty", path)) if !path.is_empty() => text.parse(),
            Some(("tcp", _)) => text.parse(),
            _ => Err(format!(
                "`{text}` is no port to make; write pty:PATH, such as pty:/tmp/board, or \
                 tcp:HOST:PORT, such as tcp:127.0.0.1:5555"
            )),
        }
    }

    /// Returns advice for the user when the port does not open.
    pub(crate) fn remedy(&self, error: io::ErrorKind) -> String {
        match (error, self) {
            (io::ErrorKind::NotFound, PortAddress::Auto(_)) => {
                "plug the board in; corticode-bridge ports lists what is connected".to_owned()
            }
            (io::ErrorKind::ResourceBusy, PortAddress::Auto(_)) => {
                "another program uses it; corticode-bridge ports names the program".to_owned()
            }
            (io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused, _) => {
                "plug the device in, or start host-sim".to_owned()
            }
            (io::ErrorKind::PermissionDenied, _) => {
                "permission denied: run sudo usermod -aG dialout $USER, then log in again"
                    .to_owned()
            }
            (io::ErrorKind::ResourceBusy, PortAddress::Tty(path)) => {
                format!("another program uses it: fuser -v {}", path.display())
            }
            _ => "check --port".to_owned(),
        }
    }
}

impl fmt::Display for PortAddress {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PortAddress::Tty(path) => write!(formatter, "{}", path.display()),
            PortAddress::Tcp(address) => write!(formatter, "tcp:{address}"),
            PortAddress::Auto(None) => write!(formatter, "auto"),
            PortAddress::Auto(Some(serial)) => write!(formatter, "auto:{serial}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::PortAddress;

    #[test]
    fn a_port_to_make_is_a_terminal_or_a_tcp_port() {
        let tty = PortAddress::Tty("/tmp/board".into());
        assert_eq!(PortAddress::parse_output("pty:/tmp/board"), Ok(tty));
        assert!(PortAddress::parse_output("tcp:localhost:5555").is_ok());
        for wrong in [
            "/tmp",
            "pty:",
            "file:x",
            "auto",
            "5555",
            "tcp:localhost:99999",
        ] {
            let error = PortAddress::parse_output(wrong).unwrap_err();
            assert!(error.contains("write"), "{wrong}: {error}");
        }
    }

    #[test]
    fn paths_and_tcp_addresses_are_distinguished() {
        let tty = PortAddress::Tty("/dev/ttyACM0".into());
        assert_eq!("/dev/ttyACM0".parse(), Ok(tty.clone()));
        assert_eq!("pty:/dev/ttyACM0".parse(), Ok(tty));
        assert_eq!(
            "tcp:[::1]:5".parse(),
            Ok(PortAddress::Tcp("[::1]:5".to_owned()))
        );
        // A colon alone does not make a TCP address.
        let by_id = PortAddress::Tty("/dev/serial/by-path/pci-0:1".into());
        assert_eq!("/dev/serial/by-path/pci-0:1".parse(), Ok(by_id));
        assert_eq!("auto".parse(), Ok(PortAddress::Auto(None)));
        let serial = PortAddress::Auto(Some("3A".to_owned()));
        assert_eq!("auto:3A".parse(), Ok(serial));
        assert_eq!("./auto".parse(), Ok(PortAddress::Tty("./auto".into())));
        assert_eq!("./5555".parse(), Ok(PortAddress::Tty("./5555".into())));
        assert_eq!("board".parse(), Ok(PortAddress::Tty("board".into())));
        for wrong in ["5555", "99999", "localhost:5555", "127.0.0.1:99999"] {
            let error = wrong.parse::<PortAddress>().unwrap_err();
            assert!(error.contains("write tcp:HOST:PORT"), "{wrong}: {error}");
        }
        for wrong in ["", "auto:", "tcp:", "tcp:host", "tcp::5", "tcp:host:99999"] {
            let error = wrong.parse::<PortAddress>().unwrap_err();
            assert!(error.contains("write"), "{wrong}: {error}");
        }
    }
}
