//! The virtual board's end of a port: pseudo-terminal, TCP listener or file.

use std::{
    fmt,
    fs::{self, File},
    io::{self, Read, Write},
    net::{TcpListener, TcpStream},
    os::fd::OwnedFd,
    path::{Path, PathBuf},
    str::FromStr,
    sync::{Arc, Mutex, PoisonError, mpsc},
    thread,
    time::{Duration, Instant},
};

use rustix::{
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{OptionalActions, tcgetattr, tcsetattr},
};

use crate::{Outbox, WhenFull};

/// Pause before something is tried again that just failed.
const RETRY: Duration = Duration::from_millis(20);

/// How often a host that is behind is looked at.
const POLL: Duration = Duration::from_millis(2);

/// Bytes that a terminal may hold for a host that is behind: half a second of codes. The kernel
/// alone would take 64 KB, half a minute of codes that are stale when the host reads them.
const UNREAD_AT_MOST: u64 = 1_024;

/// Where the frames go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// A pseudo-terminal; the path becomes a link to it.
    Pty(PathBuf),
    /// A TCP port that one host at a time may connect to.
    Tcp(String),
    /// A file; no commands come back, so the codes start at once.
    File(PathBuf),
}

impl FromStr for Output {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("pty", path)) if !path.is_empty() => Ok(Self::Pty(path.into())),
            Some(("tcp", address)) if address.contains(':') => Ok(Self::Tcp(address.to_owned())),
            Some(("file", path)) if !path.is_empty() => Ok(Self::File(path.into())),
            _ => Err(format!(
                "{text:?} is no output; write pty:PATH, tcp:HOST:PORT or file:PATH"
            )),
        }
    }
}

impl fmt::Display for Output {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pty(path) => write!(f, "pty:{}", path.display()),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::File(path) => write!(f, "file:{}", path.display()),
        }
    }
}

/// An output that could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// No pseudo-terminal.
    #[error("cannot open a pseudo-terminal; is /dev/pts mounted?")]
    Pty(#[source] io::Error),
    /// The link to the pseudo-terminal could not be made.
    #[error("cannot make the link {path}; choose a path in a folder that you may write to")]
    Link {
        /// Path of the link.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// Something other than a link lies where the link should be.
    #[error("{path} exists and is no link; remove it or choose another path")]
    Occupied {
        /// Path of the link.
        path: PathBuf,
    },
    /// The TCP port could not be opened.
    #[error("cannot listen on {address}; is another program using the port?")]
    Listen {
        /// Address asked for.
        address: String,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The file could not be created.
    #[error("cannot write {path}")]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
}

/// An open output: a thread writes the outbox to it, another one reads commands.
pub struct Port {
    commands: mpsc::Receiver<Vec<u8>>,
    pty: Option<Pty>,
}

struct Pty {
    link: PathBuf,
    /// Held open, so that a host may close the terminal and open it again.
    terminal: OwnedFd,
}

impl Port {
    /// Opens the output and starts to write the outbox to it.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(output: &Output, outbox: &Outbox) -> Result<Self, PortError> {
        let (sender, commands) = mpsc::channel();
        let pty = match output {
            Output::Pty(link) => {
                let (controller, pty) = open_pty(link)?;
                let reader = controller.try_clone().map_err(PortError::Pty)?;
                thread::spawn(move || forward(reader, &sender));
                let outbox = outbox.clone();
                let terminal = pty.terminal.try_clone().map_err(PortError::Pty)?;
                thread::spawn(move || write_all_to(controller, || unread_in(&terminal), &outbox));
                Some(pty)
            }
            Output::Tcp(address) => {
                let listen = |source| PortError::Listen {
                    address: address.clone(),
                    source,
                };
                let listener = TcpListener::bind(address).map_err(listen)?;
                serve(listener, outbox, &sender);
                None
            }
            Output::File(path) => {
                let file = File::create(path).map_err(|source| PortError::File {
                    path: path.clone(),
                    source,
                })?;
                let outbox = outbox.clone();
                thread::spawn(move || write_all_to(file, || 0, &outbox));
                None
            }
        };
        Ok(Self { commands, pty })
    }

    /// Bytes from the host that have come meanwhile.
    pub fn received(&self) -> impl Iterator<Item = Vec<u8>> {
        self.commands.try_iter()
    }

    /// Waits for bytes from the host, at most `patience`.
    pub fn wait(&self, patience: Duration) -> Option<Vec<u8>> {
        match self.commands.recv_timeout(patience) {
            Ok(bytes) => Some(bytes),
            Err(mpsc::RecvTimeoutError::Timeout) => None,
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                thread::sleep(patience);
                None
            }
        }
    }

    /// Waits until the host has read what was written, at most `patience`, and gives the bytes that
    /// it has not read: closing a pseudo-terminal throws them away.
    pub fn linger(&self, patience: Duration) -> u64 {
        let Some(pty) = &self.pty else { return 0 };
        let unread = || unread_in(&pty.terminal);
        let deadline = Instant::now() + patience;
        // Bytes may still be on their way to the terminal's queue: it must be empty twice.
        let mut empty = 0;
        while Instant::now() < deadline && empty < 2 {
            thread::sleep(RETRY);
            empty = if unread() == 0 { empty + 1 } else { 0 };
        }
        unread()
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        if let Some(pty) = &self.pty {
            // Nothing to do about a link that is gone already.
            let _ = fs::remove_file(&pty.link);
        }
    }
}

/// Bytes that wait in a terminal for the host to read them; 4095 stands for more.
fn unread_in(terminal: &OwnedFd) -> u64 {
    rustix::io::ioctl_fionread(terminal).unwrap_or(0)
}

fn open_pty(link: &Path) -> Result<(File, Pty), PortError> {
    let open = || -> rustix::io::Result<(OwnedFd, String, OwnedFd)> {
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&controller)?;
        unlockpt(&controller)?;
        let name = ptsname(&controller, Vec::new())?
            .to_string_lossy()
            .into_owned();
        let terminal = rustix::fs::open(
            &name,
            rustix::fs::OFlags::RDWR | rustix::fs::OFlags::NOCTTY,
            rustix::fs::Mode::empty(),
        )?;
        let mut settings = tcgetattr(&terminal)?;
        settings.make_raw();
        tcsetattr(&terminal, OptionalActions::Now, &settings)?;
        Ok((controller, name, terminal))
    };
    let (controller, name, terminal) = open().map_err(|errno| PortError::Pty(errno.into()))?;
    match fs::symlink_metadata(link) {
        Ok(found) if !found.is_symlink() => {
            return Err(PortError::Occupied {
                path: link.to_owned(),
            });
        }
        // A link that an earlier run left behind.
        Ok(_) => drop(fs::remove_file(link)),
        Err(_) => {}
    }
    std::os::unix::fs::symlink(&name, link).map_err(|source| PortError::Link {
        path: link.to_owned(),
        source,
    })?;
    Ok((
        File::from(controller),
        Pty {
            link: link.to_owned(),
            terminal,
        },
    ))
}

/// Writes frames until the outbox is closed; a frame that cannot be written is counted.
///
/// Before each frame it waits until `unread`, the bytes that the host has not read yet, is small.
fn write_all_to(mut out: impl Write, unread: impl Fn() -> u64, outbox: &Outbox) {
    while let Some(frame) = outbox.take() {
        while unread() > UNREAD_AT_MOST && !outbox.is_closed() {
            thread::sleep(POLL);
        }
        match out.write_all(&frame).and_then(|()| out.flush()) {
            Ok(()) => outbox.written(),
            Err(error) => outbox.lost(error),
        }
    }
}

/// Hands what the host sends to the board until either is gone.
fn forward(mut input: impl Read, commands: &mpsc::Sender<Vec<u8>>) {
    let mut buffer = [0; 512];
    loop {
        match input.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => {
                if commands.send(buffer[..count].to_vec()).is_err() {
                    return;
                }
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}

/// The host that is connected now, if one is.
type CurrentHost = Arc<Mutex<Option<Arc<TcpStream>>>>;

/// Serves one host at a time; a new connection takes over from the old one. Without a host, frames
/// are dropped and counted, or, in virtual time, wait for one.
fn serve(listener: TcpListener, outbox: &Outbox, commands: &mpsc::Sender<Vec<u8>>) {
    let host = CurrentHost::default();
    let (current, commands) = (host.clone(), commands.clone());
    thread::spawn(move || accept(&listener, &current, &commands));
    let outbox = outbox.clone();
    thread::spawn(move || {
        while let Some(frame) = outbox.take() {
            match send(&frame, &host, &outbox) {
                Ok(()) => outbox.written(),
                Err(error) => outbox.lost(error),
            }
        }
    });
}

fn accept(listener: &TcpListener, current: &CurrentHost, commands: &mpsc::Sender<Vec<u8>>) {
    loop {
        let Ok((stream, _)) = listener.accept() else {
            // Out of descriptors, most likely: trying again at once would only burn the processor.
            thread::sleep(RETRY);
            continue;
        };
        let (Ok(()), Ok(reader)) = (stream.set_nodelay(true), stream.try_clone()) else {
            continue;
        };
        let mut current = current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(old) = current.replace(Arc::new(stream)) {
            // The old host may be gone already.
            let _ = old.shutdown(std::net::Shutdown::Both);
        }
        let commands = commands.clone();
        thread::spawn(move || forward(reader, &commands));
    }
}

/// Sends a frame to the current host. In virtual time a frame waits until a host takes it.
fn send(frame: &[u8], host: &CurrentHost, outbox: &Outbox) -> io::Result<()> {
    loop {
        let current = host.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let outcome = match current {
            Some(current) => (&*current).write_all(frame),
            None => Err(io::ErrorKind::NotConnected.into()),
        };
        if outcome.is_ok() || outbox.when_full() == WhenFull::DropOldest || outbox.is_closed() {
            return outcome;
        }
        thread::sleep(RETRY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_is_read_from_its_text() {
        assert_eq!(
            "pty:/tmp/board".parse(),
            Ok(Output::Pty("/tmp/board".into()))
        );
        assert_eq!(
            "tcp:[::1]:7000".parse(),
            Ok(Output::Tcp("[::1]:7000".into()))
        );
        assert_eq!(
            "file:codes.bin".parse(),
            Ok(Output::File("codes.bin".into()))
        );
        for wrong in ["pty:", "tcp:7000", "/dev/ttyACM0", "udp:1.2.3.4:5"] {
            assert!(wrong.parse::<Output>().is_err(), "{wrong}");
        }
    }
}
