//! Addresses of ports, and a port that is open.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;
use std::{fmt, io};

use rustix::fs::{FlockOperation, Mode, OFlags};
use rustix::io::Errno;
use rustix::net::sockopt;
use rustix::termios::{self, ControlModes, OptionalActions};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::unix::pipe::{Receiver, Sender};
use tokio::time::timeout;

use crate::ports::system_root::SystemRoot;

/// Timeout for connecting to a TCP port, and for a port that accepts none of the outgoing bytes.
pub(crate) const PORT_TIMEOUT: Duration = Duration::from_secs(3);

#[derive(Debug)]
pub(crate) enum Port {
    /// A serial port or a pseudoterminal in raw mode. Tokio's pipe ends are used because they
    /// accept any descriptor that epoll accepts, and need no unsafe code here.
    Tty(Receiver, Sender),
    Tcp(TcpStream),
}

impl Port {
    /// Opens the port. A serial port or pseudoterminal is locked for this program and set to raw
    /// mode at `baud`, which has no effect on USB and pseudoterminals.
    ///
    /// # Errors
    ///
    /// The operating system's error; `InvalidInput` if the path is not a terminal, `Unsupported` if
    /// the terminal refuses `baud`, `ResourceBusy` if another program has locked it.
    pub(crate) async fn open(address: &PortAddress, baud: u32) -> io::Result<Port> {
        match address {
            PortAddress::Tcp(address) => {
                let stream = timeout(PORT_TIMEOUT, TcpStream::connect(address)).await??;
                stream.set_nodelay(true)?;
                detect_broken_connection(&stream)?;
                Ok(Port::Tcp(stream))
            }
            PortAddress::Auto(_) => Err(io::ErrorKind::InvalidInput.into()),
            PortAddress::Tty(path) => {
                let terminal = open_raw(path, baud)?;
                let receiver = Receiver::from_file_unchecked(terminal.try_clone()?)?;
                Ok(Port::Tty(receiver, Sender::from_file_unchecked(terminal)?))
            }
        }
    }

    /// Waits until at least one byte is read, or a part of `outgoing` is written. Cancel safe: if
    /// the future is dropped before it completes, no byte was read or written.
    ///
    /// # Errors
    ///
    /// `UnexpectedEof` if the other end closed the port, else the operating system's error.
    pub(crate) async fn exchange(
        &mut self,
        buffer: &mut [u8],
        outgoing: &[u8],
    ) -> io::Result<Transfer> {
        match self {
            Port::Tcp(stream) => {
                let (reader, writer) = stream.split();
                exchange(reader, buffer, writer, outgoing).await
            }
            Port::Tty(reader, writer) => exchange(reader, buffer, writer, outgoing).await,
        }
    }
}

/// What [`Port::exchange`] has done.
#[derive(Debug)]
pub(crate) enum Transfer {
    /// Number of bytes read into the front of the buffer.
    Read(usize),
    /// Number of bytes written from the front of `outgoing`.
    Written(usize),
    /// Nothing can be written any more, but bytes that arrived before may still be unread.
    NotWritten(io::Error),
}

async fn exchange(
    mut reader: impl AsyncRead + Unpin,
    buffer: &mut [u8],
    mut writer: impl AsyncWrite + Unpin,
    outgoing: &[u8],
) -> io::Result<Transfer> {
    tokio::select! {
        count = reader.read(buffer) => match count? {
            0 => Err(io::ErrorKind::UnexpectedEof.into()),
            count => Ok(Transfer::Read(count)),
        },
        count = writer.write(outgoing), if !outgoing.is_empty() => {
            Ok(count.map_or_else(Transfer::NotWritten, Transfer::Written))
        }
    }
}

/// Makes TCP report a broken connection if the peer's machine does not answer for 10 s (power cut,
/// unplugged cable). If only the peer's program is suspended, its machine still answers.
fn detect_broken_connection(stream: &TcpStream) -> io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, Duration::from_secs(4))?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(2))?;
    sockopt::set_tcp_keepcnt(stream, 3)?;
    // TCP sends no keepalive probes while bytes are unacknowledged; this timeout covers that case.
    #[cfg(target_os = "linux")]
    sockopt::set_tcp_user_timeout(stream, 10_000)?;
    Ok(())
}

fn open_raw(path: &Path, baud: u32) -> io::Result<File> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let fd = rustix::fs::open(path, flags, Mode::empty()).map_err(|error| match error {
        Errno::ISDIR => io::Error::new(io::ErrorKind::InvalidInput, "it is a folder"),
        error => error.into(),
    })?;
    if !termios::isatty(&fd) {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "it is neither a serial port nor a pseudoterminal",
        ));
    }
    // Lock the port, because two bridges on one port would each read only some of the bytes. The
    // lock ends with this program. TIOCEXCL, in contrast, would stay set as long as another
    // program, such as host-sim, holds the terminal open.
    rustix::fs::flock(&fd, FlockOperation::NonBlockingLockExclusive).map_err(
        |error| match error {
            Errno::WOULDBLOCK => io::ErrorKind::ResourceBusy.into(),
            error => io::Error::from(error),
        },
    )?;
    let mut settings = termios::tcgetattr(&fd)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
    settings.set_speed(baud).map_err(|error| speed_error(error, baud))?;
    termios::tcsetattr(&fd, OptionalActions::Now, &settings)
        .map_err(|error| speed_error(error, baud))?;
    Ok(fd.into())
}

/// Turns `EINVAL`, which a terminal returns for a baud rate that it does not support, into an error
/// that says so. Returns other errors unchanged.
fn speed_error(error: Errno, baud: u32) -> io::Error {
    match error {
        Errno::INVAL => io::Error::new(
            io::ErrorKind::Unsupported,
            format!("it does not run at {baud} baud; choose another --baud"),
        ),
        error => error.into(),
    }
}

/// Address of the device's port, as `--port` gives it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PortAddress {
    /// Path of a serial port or a pseudoterminal.
    Tty(PathBuf),
    /// Host and port of a TCP server, written `tcp:HOST:PORT`.
    Tcp(String),
    /// The serial port to which a board is connected at the moment: for `auto` the only board, for
    /// `auto:SERIAL` the board with this serial number.
    Auto(Option<String>),
}

impl FromStr for PortAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<PortAddress, String> {
        match text.split_once(':') {
            Some(("tcp", address)) => {
                let parts = address.rsplit_once(':');
                let is_valid =
                    |(host, port): (&str, &str)| !host.is_empty() && port.parse::<u16>().is_ok();
                if parts.is_some_and(is_valid) {
                    return Ok(PortAddress::Tcp(address.to_owned()));
                }
                Err(format!(
                    "`{address}` is not a host and a port of 0 to 65535; write tcp:127.0.0.1:5555"
                ))
            }
            // host-sim prints the path of its pseudoterminal as `pty:PATH`.
            Some(("pty", path)) if !path.is_empty() => Ok(PortAddress::Tty(path.into())),
            Some(("auto", "")) => Err(
                "the serial number is missing; write auto:SERIAL, as listed by corticode-bridge ports"
                    .to_owned(),
            ),
            Some(("auto", serial)) => Ok(PortAddress::Auto(Some(serial.to_owned()))),
            None if text == "auto" => Ok(PortAddress::Auto(None)),
            Some(("file", path)) => Err(format!(
                "a file is no port; write `corticode-bridge replay {path} --output pty:/tmp/board` \
                 and --port /tmp/board, or ./{text} for a port of this name"
            )),
            _ if text.is_empty() => Err("the path is empty; write /dev/ttyACM0".to_owned()),
            _ if is_tcp_without_prefix(text) => Err(format!(
                "`{text}` is not the path of a port; write tcp:HOST:PORT, such as tcp:127.0.0.1:5555, \
                 or ./{text} for a file of this name"
            )),
            _ => Ok(PortAddress::Tty(text.into())),
        }
    }
}

/// Returns whether a text looks like a TCP address that lacks `tcp:` or `tcp:HOST:`, such as
/// `lab:5555`, rather than a path.
fn is_tcp_without_prefix(text: &str) -> bool {
    let last = text.rsplit(':').next().unwrap_or(text);
    !text.contains('/') && !last.is_empty() && last.bytes().all(|byte| byte.is_ascii_digit())
}

impl PortAddress {
    /// Parses the address of a port that the program shall make: `pty:PATH` or `tcp:HOST:PORT`.
    ///
    /// # Errors
    ///
    /// A message with the allowed forms, for any other text.
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

    /// Returns advice for the user if opening the port fails with `error`.
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
            (io::ErrorKind::PermissionDenied, PortAddress::Tty(path)) => {
                let access = SystemRoot::machine().port_access(path);
                let (what, remedy) = access.objection(path).unwrap_or_else(|| {
                    let next = format!("corticode-bridge doctor --port {}", path.display());
                    ("permission denied".to_owned(), next)
                });
                format!("{what}: {remedy}")
            }
            (io::ErrorKind::PermissionDenied, PortAddress::Tcp(_)) => {
                "permission denied: check the firewall of this machine".to_owned()
            }
            (io::ErrorKind::PermissionDenied, PortAddress::Auto(_)) => {
                "permission denied; corticode-bridge ports prints the command that helps".to_owned()
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
    use super::{Errno, PortAddress, io, speed_error};

    #[test]
    fn a_refused_baud_rate_is_named() {
        let error = speed_error(Errno::INVAL, 12_345);
        assert_eq!(error.kind(), io::ErrorKind::Unsupported);
        assert!(error.to_string().contains("12345 baud"));
        assert_eq!(speed_error(Errno::IO, 9600).raw_os_error(), Some(5));
    }

    #[test]
    fn a_port_to_make_is_a_terminal_or_a_tcp_port() {
        let tty = PortAddress::Tty("/tmp/board".into());
        assert_eq!(PortAddress::parse_output("pty:/tmp/board"), Ok(tty));
        assert!(PortAddress::parse_output("tcp:localhost:5555").is_ok());
        let wrong_port = "tcp:localhost:99999";
        for wrong in ["/tmp", "pty:", "file:x", "auto", "5555", wrong_port] {
            let error = PortAddress::parse_output(wrong).unwrap_err();
            assert!(error.contains("write"), "{wrong}: {error}");
        }
    }

    #[test]
    fn paths_and_tcp_addresses_are_distinguished() {
        let tty = PortAddress::Tty("/dev/ttyACM0".into());
        assert_eq!("/dev/ttyACM0".parse(), Ok(tty.clone()));
        assert_eq!("pty:/dev/ttyACM0".parse(), Ok(tty));
        assert_eq!("tcp:[::1]:5".parse(), Ok(PortAddress::Tcp("[::1]:5".to_owned())));
        // A colon does not make a path a TCP address.
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
