//! The device's end of a port: a pseudoterminal or a TCP port at which the bridge connects.

use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use tokio::net::TcpListener;
use tokio::net::unix::pipe::{Receiver, Sender};

use crate::wire::address::PortAddress;
use crate::wire::port::{Port, Transfer};

/// A port that one host at a time connects to.
#[derive(Debug)]
pub(crate) enum ReplayPort {
    Tty {
        port: Port,
        /// Link to the terminal, removed at the end.
        link: PathBuf,
        /// Kept open, so that a host can close the terminal and open it again.
        terminal: OwnedFd,
    },
    Tcp {
        listener: TcpListener,
        host: Option<Port>,
    },
}

impl ReplayPort {
    /// Makes the port.
    ///
    /// # Errors
    ///
    /// The operating system's error; `AlreadyExists` if the path of the link is in use.
    pub(crate) async fn open(address: &PortAddress) -> io::Result<ReplayPort> {
        match address {
            PortAddress::Tty(link) => open_terminal(link),
            PortAddress::Auto(_) => Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "auto finds boards and is no name for a port",
            )),
            PortAddress::Tcp(address) => Ok(ReplayPort::Tcp {
                listener: TcpListener::bind(address).await?,
                host: None,
            }),
        }
    }

    /// Waits until bytes were read from the host into `buffer`, or a part of `outgoing` was written.
    /// Without a host, waits for one. A host that disconnects is no error. Cancel safe.
    ///
    /// # Errors
    ///
    /// The operating system's error, if no host can connect any more.
    pub(crate) async fn exchange(
        &mut self,
        buffer: &mut [u8],
        outgoing: &[u8],
    ) -> io::Result<Transfer> {
        match self {
            ReplayPort::Tty { port, .. } => port.exchange(buffer, outgoing).await,
            ReplayPort::Tcp { listener, host } => loop {
                let Some(port) = host else {
                    let (stream, peer) = listener.accept().await?;
                    stream.set_nodelay(true)?;
                    tracing::info!("{peer} is connected");
                    *host = Some(Port::Tcp(stream));
                    continue;
                };
                match port.exchange(buffer, outgoing).await {
                    Ok(transfer) => return Ok(transfer),
                    Err(error) => {
                        tracing::info!("the host is gone ({error})");
                        *host = None;
                    }
                }
            },
        }
    }

    /// Returns the number of bytes that the host has not read, as far as it is known.
    pub(crate) fn unread(&self) -> u64 {
        match self {
            ReplayPort::Tty { terminal, .. } => rustix::io::ioctl_fionread(terminal).unwrap_or(0),
            ReplayPort::Tcp { .. } => 0,
        }
    }
}

impl Drop for ReplayPort {
    fn drop(&mut self) {
        if let ReplayPort::Tty { link, .. } = self {
            // An error means that the link is already gone.
            let _ = std::fs::remove_file(link);
        }
    }
}

fn open_terminal(link: &Path) -> io::Result<ReplayPort> {
    let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&controller)?;
    unlockpt(&controller)?;
    let name = ptsname(&controller, Vec::new())?;
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let terminal = rustix::fs::open(&*name, flags, Mode::empty())?;
    let mut settings = tcgetattr(&terminal)?;
    settings.make_raw();
    tcsetattr(&terminal, OptionalActions::Now, &settings)?;
    fcntl_setfl(&controller, OFlags::NONBLOCK)?;
    let controller = File::from(controller);
    let receiver = Receiver::from_file_unchecked(controller.try_clone()?)?;
    let port = Port::Tty(receiver, Sender::from_file_unchecked(controller)?);
    // A link to a terminal, which an earlier run left behind, is replaced, and nothing else.
    if std::fs::read_link(link).is_ok_and(|target| target.starts_with("/dev/pts")) {
        std::fs::remove_file(link)?;
    }
    symlink(name.to_str().map_err(io::Error::other)?, link)?;
    Ok(ReplayPort::Tty {
        port,
        link: link.to_owned(),
        terminal,
    })
}
