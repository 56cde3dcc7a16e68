//! The virtual board's port: pseudo-terminal, TCP listener or file.

use std::{
    fmt,
    fs::{self, File},
    io::{self, Write},
    net::TcpListener,
    os::fd::{AsFd, OwnedFd},
    path::{Path, PathBuf},
    str::FromStr,
    sync::{atomic::AtomicBool, mpsc},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use new_file::{Existing, NewFile, NewFileError};
use rustix::{
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{OptionalActions, tcgetattr, tcsetattr},
};

use super::json_lines::JsonLines;
use super::tcp::{CurrentHost, RETRY, forward, is_absent, serve, wait_until_closed};
use crate::outbox::{Outbox, WhenFull};

/// Interval between checks of how many bytes a slow host has not read.
const POLL: Duration = Duration::from_millis(2);

/// Number of unread bytes in a terminal above which no frame is written: about half a second of
/// codes. Without this limit, the kernel would buffer 64 KB, about half a minute of codes, and a
/// slow host would read codes of that age.
const MAX_UNREAD: u64 = 1_024;

/// Destination of the frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// A pseudo-terminal. Holds the path of the symbolic link to the terminal.
    Pty(PathBuf),
    /// A TCP port for one host at a time. Holds the address to listen on, HOST:PORT.
    Tcp(String),
    /// A file of frames, or standard output for the path `-`. No commands come from a file, so the
    /// streams start at once.
    File(PathBuf),
    /// A file of lines of JSON, or standard output for the path `-`.
    JsonLines(PathBuf),
}

impl Output {
    /// Returns the path of an output that is a file; `None` for an output with a host, which sends
    /// commands.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) | Self::JsonLines(path) => Some(path),
            Self::Pty(_) | Self::Tcp(_) => None,
        }
    }

    pub(crate) fn is_stdout(&self) -> bool {
        self.file() == Some(Path::new(STDOUT))
    }
}

/// Path that stands for standard output.
const STDOUT: &str = "-";

impl FromStr for Output {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("pty", path)) if !path.is_empty() => Ok(Self::Pty(path.into())),
            Some(("tcp", address)) => match address.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {
                    Ok(Self::Tcp(address.to_owned()))
                }
                _ => Err(format!(
                    "'{address}' is not a host and a port of 0 to 65535; write tcp:127.0.0.1:5555"
                )),
            },
            Some(("file", path)) if !path.is_empty() => Ok(Self::File(path.into())),
            Some(("ndjson", path)) if !path.is_empty() => Ok(Self::JsonLines(path.into())),
            _ => Err(format!(
                "'{text}' is no output; write pty:PATH, tcp:HOST:PORT or file:PATH, or ndjson:PATH for \
                 lines of JSON; the path - is standard output"
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
            Self::JsonLines(path) => write!(f, "ndjson:{}", path.display()),
        }
    }
}

/// Why an output could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The system provides no pseudo-terminal.
    #[error("cannot open a pseudo-terminal; is /dev/pts mounted?")]
    Pty(#[source] io::Error),
    /// The symbolic link to the pseudo-terminal could not be created; holds its path, and the error
    /// from the `symlink` system call.
    #[error("cannot make the link {0}; choose a path in a writable folder")]
    Link(PathBuf, #[source] io::Error),
    /// Something other than a symbolic link to a terminal exists at the path of the link; holds the
    /// path.
    #[error("{0} exists and is no link to a pseudoterminal; remove it or choose another path")]
    Occupied(PathBuf),
    /// The TCP port could not be opened; holds the address, and the error from resolving it or from
    /// listening.
    #[error("cannot listen on {0}; is another program using the port?")]
    Listen(String, #[source] io::Error),
    /// The file could not be created, or it must not be replaced.
    #[error(transparent)]
    File(#[from] NewFileError),
}

impl PortError {
    /// Returns whether the user can mend the failure with another name for the output; otherwise
    /// the system is at fault.
    pub(crate) fn is_wrong_name(&self) -> bool {
        matches!(self, Self::Occupied(_) | Self::Link(..) | Self::File(_))
    }
}

/// An open output. One thread writes the frames of the outbox to the output; another thread reads
/// the host's commands.
pub struct Port {
    commands: mpsc::Receiver<Vec<u8>>,
    pty: Option<Pty>,
    /// Host of a TCP port in virtual time, where the board waits for its host; `None` for any other
    /// output.
    waiting_host: Option<CurrentHost>,
    /// The file that is written; `None` if there is no file or it is standard output.
    file: Option<NewFile>,
    /// The thread that writes the file; `None` if the output is not a file.
    writer: Option<JoinHandle<()>>,
}

/// Which files may be replaced when an output that is a file is opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileRules {
    /// Whether a file with the name of the output is replaced.
    pub existing: Existing,
    /// Files that the program reads, which are never replaced.
    pub inputs: Vec<PathBuf>,
}

struct Pty {
    link: PathBuf,
    /// Path of the terminal, to which the link points.
    name: PathBuf,
    /// File descriptor that stays open, so that a host can close the terminal and open it again.
    terminal: OwnedFd,
}

impl Port {
    /// Opens the output and starts the thread that writes the outbox to it.
    ///
    /// # Errors
    /// [`PortError`] if the terminal, its link, the TCP port or the file cannot be opened.
    pub fn open(output: &Output, rules: &FileRules, outbox: &Outbox) -> Result<Self, PortError> {
        let (sender, commands) = mpsc::channel();
        let (mut waiting_host, mut file, mut writer) = (None, None, None);
        let pty = match output {
            Output::Pty(link) => {
                let (controller, pty) = open_pty(link)?;
                let reader = controller.try_clone().map_err(PortError::Pty)?;
                thread::spawn(move || forward(reader, &sender));
                let outbox = outbox.clone();
                let terminal = pty.terminal.try_clone().map_err(PortError::Pty)?;
                let write = to_file(controller);
                thread::spawn(move || write_all(write, || unread_in(&terminal), &outbox));
                Some(pty)
            }
            Output::Tcp(address) => {
                let listen = |error| PortError::Listen(address.clone(), error);
                let listener = TcpListener::bind(address).map_err(listen)?;
                let host = serve(listener, outbox, &sender);
                waiting_host = (outbox.when_full() == WhenFull::Wait).then_some(host);
                None
            }
            Output::File(path) | Output::JsonLines(path) => {
                let create = |source| NewFileError::Create { path: path.clone(), source };
                let handle = if output.is_stdout() {
                    let stdout = io::stdout().as_fd().try_clone_to_owned();
                    stdout.map(File::from).map_err(create)?
                } else {
                    let new = NewFile::create(path, rules.existing, &rules.inputs)?;
                    file.insert(new).handle().map_err(create)?
                };
                let outbox = outbox.clone();
                let mut write = to_file(handle);
                let mut lines = matches!(output, Output::JsonLines(_)).then(JsonLines::default);
                let write = move |frame: &[u8]| match &mut lines {
                    None => write(frame),
                    Some(lines) => lines.line(frame)?.map_or(Ok(()), |line| write(&line)),
                };
                writer = Some(thread::spawn(move || write_all(write, || 0, &outbox)));
                None
            }
        };
        Ok(Self { commands, pty, waiting_host, file, writer })
    }

    /// Waits until the thread that writes a file has ended; the outbox must be drained and closed
    /// first. Returns false if the thread has panicked.
    pub fn join_writer(&mut self) -> bool {
        let writer = self.writer.take();
        writer.is_none_or(|writer| writer.join().is_ok())
    }

    /// Moves the complete file from its temporary name to the output's name; does nothing for other
    /// outputs.
    ///
    /// # Errors
    /// [`NewFileError`] if the file cannot be completed.
    pub fn finish_file(&mut self) -> Result<(), NewFileError> {
        self.file.take().map_or(Ok(()), NewFile::finish)
    }

    /// Returns whether this is a TCP port in virtual time without a host.
    pub fn lacks_host(&self) -> bool {
        self.waiting_host.as_ref().is_some_and(is_absent)
    }

    /// Returns the chunks of bytes that the host has sent since the last call, without waiting.
    pub fn received(&self) -> impl Iterator<Item = Vec<u8>> {
        self.commands.try_iter()
    }

    /// Waits for bytes from the host, at most `timeout`. Returns `None` on a timeout.
    pub fn receive_timeout(&self, timeout: Duration) -> Option<Vec<u8>> {
        match self.commands.recv_timeout(timeout) {
            Ok(bytes) => Some(bytes),
            Err(mpsc::RecvTimeoutError::Timeout) => None,
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                thread::sleep(timeout);
                None
            }
        }
    }

    /// Waits until the host has read everything, at most `timeout`, and returns the number of
    /// unread bytes. Closing a pseudo-terminal discards unread bytes.
    ///
    /// For a TCP port in virtual time, waits until the host closes the connection or `stop` is set,
    /// at most a minute, and returns 0: if this program ended earlier, a command that arrives later
    /// would make the kernel discard what the host has not read. For other outputs, returns 0 at
    /// once.
    pub fn wait_until_read(&self, timeout: Duration, stop: &AtomicBool) -> u64 {
        if let Some(host) = &self.waiting_host {
            wait_until_closed(host, stop);
            return 0;
        }
        let Some(pty) = &self.pty else { return 0 };
        let unread = || unread_in(&pty.terminal);
        let deadline = Instant::now() + timeout;
        // On a busy PC, written bytes reach the terminal's queue late, so several consecutive
        // checks must find the queue empty.
        let mut empty = 0;
        while Instant::now() < deadline && empty < EMPTY_CHECKS {
            thread::sleep(RETRY);
            empty = if unread() == 0 { empty + 1 } else { 0 };
        }
        unread()
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        // Another program may have replaced the link, so remove it only if it still names our
        // terminal.
        if let Some(pty) = &self.pty
            && fs::read_link(&pty.link).is_ok_and(|target| target == pty.name)
        {
            // An error means that the link is already gone.
            let _ = fs::remove_file(&pty.link);
        }
    }
}

/// Number of consecutive checks, [`RETRY`] apart, that must find a terminal's queue empty before it
/// counts as read.
const EMPTY_CHECKS: u32 = 10;

/// Returns the number of bytes in a terminal that the host has not read. The kernel counts at most
/// 4095.
fn unread_in(terminal: &OwnedFd) -> u64 {
    rustix::io::ioctl_fionread(terminal).unwrap_or(0)
}

fn open_pty(link: &Path) -> Result<(File, Pty), PortError> {
    let open = || -> rustix::io::Result<(OwnedFd, String, OwnedFd)> {
        let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&controller)?;
        unlockpt(&controller)?;
        let name = ptsname(&controller, Vec::new())?.to_string_lossy().into_owned();
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
    // Replace a link to a terminal, which an earlier run has left, but no other file.
    match fs::read_link(link) {
        Ok(target) if target.starts_with("/dev/pts") => drop(fs::remove_file(link)),
        _ if fs::symlink_metadata(link).is_ok() => {
            return Err(PortError::Occupied(link.to_owned()));
        }
        _ => {}
    }
    let linked = std::os::unix::fs::symlink(&name, link);
    linked.map_err(|error| PortError::Link(link.to_owned(), error))?;
    Ok((File::from(controller), Pty { link: link.to_owned(), name: name.into(), terminal }))
}

fn to_file(mut file: File) -> impl FnMut(&[u8]) -> io::Result<()> {
    move |bytes| file.write_all(bytes)
}

/// Writes frames until the outbox is closed; a frame that cannot be written is counted as lost.
///
/// Before each frame, waits until the host has at most [`MAX_UNREAD`] bytes to read; `unread`
/// returns their number.
pub(super) fn write_all(
    mut write: impl FnMut(&[u8]) -> io::Result<()>,
    unread: impl Fn() -> u64,
    outbox: &Outbox,
) {
    while let Some(frame) = outbox.pop() {
        while unread() > MAX_UNREAD && !outbox.is_closed() {
            thread::sleep(POLL);
        }
        match write(&frame) {
            Ok(()) => outbox.mark_written(),
            Err(error) => outbox.mark_lost(error),
        }
    }
}
