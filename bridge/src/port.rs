//! The open port.

use std::fs::File;
use std::io;
use std::path::Path;
use std::time::Duration;

use rustix::fs::{Mode, OFlags};
use rustix::termios::{self, ControlModes, OptionalActions};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::unix::pipe::{Receiver, Sender};
use tokio::time::timeout;

use crate::PortAddress;

/// How long opening, or writing one command, may take.
const PATIENCE: Duration = Duration::from_secs(3);

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
                let stream = timeout(PATIENCE, TcpStream::connect(address)).await??;
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

    /// Bytes that have come, at least one; waits for them. Safe to cancel.
    ///
    /// # Errors
    ///
    /// `UnexpectedEof` if the other end closed it; else what the system says.
    pub(crate) async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = match self {
            Port::Tcp(stream) => stream.read(buffer).await?,
            Port::Tty(receiver, _) => receiver.read(buffer).await?,
        };
        match count {
            0 => Err(io::ErrorKind::UnexpectedEof.into()),
            count => Ok(count),
        }
    }

    /// Write all of `bytes`; gives up after 3 s, so that a device that does not read cannot stop
    /// the bridge.
    ///
    /// # Errors
    ///
    /// `TimedOut`, or what the system says.
    pub(crate) async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Port::Tcp(stream) => timeout(PATIENCE, stream.write_all(bytes)).await?,
            Port::Tty(_, sender) => timeout(PATIENCE, sender.write_all(bytes)).await?,
        }
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
    // A second bridge on the same port would take every other byte; root is let in all the same.
    termios::ioctl_tiocexcl(&fd)?;
    let mut settings = termios::tcgetattr(&fd)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
    settings.set_speed(baud)?;
    termios::tcsetattr(&fd, OptionalActions::Now, &settings)?;
    Ok(fd.into())
}
