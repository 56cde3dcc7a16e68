//! The open port.

use std::fs::File;
use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{FlockOperation, Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::{self, ControlModes, OptionalActions};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::unix::pipe::{Receiver, Sender};
use tokio::time::timeout;

use crate::wire::address::PortAddress;

/// How long opening, or writing one command, may take.
pub(crate) const PORT_TIMEOUT: Duration = Duration::from_secs(3);

/// The open port: bytes in both directions.
#[derive(Debug)]
pub(crate) enum Port {
    /// A serial port or a pseudoterminal in raw mode. Tokio's pipe ends are what it offers for
    /// readable and writable descriptors without unsafe code; they serve any that epoll takes.
    Tty(Receiver, Sender),
    /// A TCP connection.
    Tcp(TcpStream),
}

impl Port {
    /// Open it. A terminal goes into raw mode at `baud` (which a pseudoterminal and USB ignore),
    /// and is taken for this program alone.
    ///
    /// # Errors
    ///
    /// What the system says; `InvalidInput` if the path is no terminal at all.
    pub(crate) async fn open(address: &PortAddress, baud: u32) -> io::Result<Port> {
        match address {
            PortAddress::Tcp(address) => {
                let stream = timeout(PORT_TIMEOUT, TcpStream::connect(address)).await??;
                stream.set_nodelay(true)?;
                Ok(Port::Tcp(stream))
            }
            PortAddress::Tty(path) => {
                let terminal = open_raw(path, baud)?;
                let receiver = Receiver::from_file_unchecked(terminal.try_clone()?)?;
                Ok(Port::Tty(receiver, Sender::from_file_unchecked(terminal)?))
            }
        }
    }

    /// Bytes that have come, at least one, or how much of `outgoing` was written; waits for
    /// either. Safe to cancel: what is not told has not happened.
    ///
    /// # Errors
    ///
    /// `UnexpectedEof` if the other end closed it; else what the system says.
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

/// What went through a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Transfer {
    /// So many bytes are at the front of the buffer.
    Read(usize),
    /// So many bytes were written.
    Written(usize),
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
        count = writer.write(outgoing), if !outgoing.is_empty() => count.map(Transfer::Written),
    }
}

fn open_raw(path: &Path, baud: u32) -> io::Result<File> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let fd = rustix::fs::open(path, flags, Mode::empty())?;
    if !termios::isatty(&fd) {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "it is no serial port and no pseudoterminal",
        ));
    }
    // A second bridge on the same port would take every other byte.
    // TIOCEXCL would outlive this program while another one, such as host-sim, holds the terminal.
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

/// What a refused speed means to the user.
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
    fn a_speed_that_the_port_refuses_is_named() {
        let error = speed_error(Errno::INVAL, 12_345);
        assert_eq!(error.kind(), io::ErrorKind::Unsupported);
        assert!(error.to_string().contains("12345 baud"));
        assert_eq!(speed_error(Errno::IO, 9600).raw_os_error(), Some(5));
    }
}
