//! An open serial port, pseudoterminal or TCP connection.

use std::fs::File;
use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{FlockOperation, Mode, OFlags};
use rustix::io::Errno;
use rustix::net::sockopt;
use rustix::termios::{self, ControlModes, OptionalActions};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::unix::pipe::{Receiver, Sender};
use tokio::time::timeout;

use crate::wire::address::PortAddress;

/// Timeout for opening a TCP connection, and for writing outgoing bytes to the port.
pub(crate) const PORT_TIMEOUT: Duration = Duration::from_secs(3);

#[derive(Debug)]
pub(crate) enum Port {
    /// A serial port or a pseudoterminal in raw mode. Uses Tokio's pipe ends, which accept any
    /// descriptor that epoll accepts and need no unsafe code here.
    Tty(Receiver, Sender),
    Tcp(TcpStream),
}

impl Port {
    /// Opens the port. A terminal is locked for this program and set to raw mode at `baud`, which
    /// pseudoterminals and USB ignore.
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

/// Result of [`Port::exchange`].
#[derive(Debug)]
pub(crate) enum Transfer {
    /// Number of bytes read into the front of the buffer.
    Read(usize),
    /// Number of bytes written from the front of `outgoing`.
    Written(usize),
    /// Nothing can be written any more. Bytes that arrived before may still be unread.
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

/// Makes TCP report a peer whose machine does not answer for 10 s (power cut, unplugged cable). The
/// machine of a program that stands still does answer.
fn detect_broken_connection(stream: &TcpStream) -> io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, Duration::from_secs(4))?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(2))?;
    sockopt::set_tcp_keepcnt(stream, 3)?;
    // Keepalive does not apply while commands are unacknowledged.
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
    // lock is released when this program ends. TIOCEXCL, in contrast, would stay set as long as
    // another program, such as host-sim, holds the terminal open.
    rustix::fs::flock(&fd, FlockOperation::NonBlockingLockExclusive).map_err(
        |error| match error {
            Errno::WOULDBLOCK => io::ErrorKind::ResourceBusy.into(),
            error => io::Error::from(error),
        },
    )?;
    let mut settings = termios::tcgetattr(&fd)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
    settings
        .set_speed(baud)
        .map_err(|error| speed_error(error, baud))?;
    termios::tcsetattr(&fd, OptionalActions::Now, &settings)
        .map_err(|error| speed_error(error, baud))?;
    Ok(fd.into())
}

/// Explains the error `EINVAL` of a terminal that does not support the baud rate; returns other
/// errors unchanged.
fn speed_error(error: Errno, baud: u32) -> io::Error {
    match error {
        Errno::INVAL => io::Error::new(
            io::ErrorKind::Unsupported,
            format!("it does not run at {baud} baud; choose another --baud"),
        ),
        error => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Errno, io, speed_error};

    #[test]
    fn a_refused_baud_rate_is_named() {
        let error = speed_error(Errno::INVAL, 12_345);
        assert_eq!(error.kind(), io::ErrorKind::Unsupported);
        assert!(error.to_string().contains("12345 baud"));
        assert_eq!(speed_error(Errno::IO, 9600).raw_os_error(), Some(5));
    }
}
