//! The subcommand `replay`: plays a recording to a host on a pseudoterminal or TCP port, or to a
//! live page.

use std::fs::File;
use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{fmt, io};

use bridge_core::{AnnouncedStream, Exclusions, HostTime, Settings};
use capture::{Pace, RecordingError, ReplayCounts, Replayer};
use clap::Args;
use indicatif::ProgressBar;
use link::Streams;
use neuro_ros::GET_INFO_SERVICE;
use neuro_ros::ros1::NodeOptions;
use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use tokio::net::TcpListener;
use tokio::net::unix::pipe::{Receiver, Sender};
use tokio::time::{Instant, sleep, sleep_until};

use crate::app::bridge::{FinalCounts, LivePage, Publication};
use crate::app::command_line::ViewOptions;
use crate::app::replay_feed::ReplayFeed;
use crate::app::shutdown::Shutdown;
use crate::error::BridgeError;
use crate::wire::port::{Port, PortAddress, Transfer};

/// Time for which the replay still answers the host's commands after the last frame.
const LINGER: Duration = Duration::from_secs(1);
/// Time limit for the host to read everything after the last frame.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(5);
/// Number of bytes that may wait for the host before the replay stops sending further frames.
const MAX_WAITING: usize = 64 * 1024;
/// Interval at which the progress display is updated.
const TICK: Duration = Duration::from_millis(100);

/// Play a recording as the device that was recorded, at a pseudoterminal or a TCP port, or on a
/// live page with --live.
///
/// The bridge connects to this port with --port as to a board: Identify is answered with the
/// recorded device's introduction, and each Start plays the recording from its beginning.
/// Self-test, reset and clock queries are answered with NotSupported. Ends after the last frame.
///
/// Exit status: 0 done, 2 wrong usage, no usable recording or port.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReplayOptions {
    /// Recording to read
    pub(crate) file: PathBuf,
    /// Port to make: pty:PATH (a link to a pseudoterminal) or tcp:HOST:PORT
    #[arg(
        long,
        value_name = "pty:PATH|tcp:HOST:PORT",
        value_parser = PortAddress::parse_output,
        required_unless_present = "live"
    )]
    pub(crate) output: Option<PortAddress>,
    /// Show the recording on a live page in a browser instead; prints the page's address and runs
    /// until Ctrl-C
    #[arg(long, conflicts_with_all = ["output", "fast"])]
    pub(crate) live: bool,
    /// Folder of the model to decode with for --live, instead of the built-in one
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) viewing: ViewOptions,
    /// Send as fast as the host reads, not in real time; times of arrival then mean nothing
    #[arg(long)]
    pub(crate) fast: bool,
}

/// Summary of a replay; prints as one line.
#[derive(Debug)]
pub(crate) struct ReplaySummary {
    path: PathBuf,
    counts: ReplayCounts,
}

impl fmt::Display for ReplaySummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ReplayCounts { frames, codes, blocks, unusable } = self.counts;
        let path = self.path.display();
        write!(
            formatter,
            "{path}: played {codes} codes and {blocks} packed blocks in {frames} frames; left out {unusable} damaged or newer \
             frames"
        )
    }
}

/// Plays a recording until its end, SIGTERM or Ctrl-C.
///
/// # Errors
///
/// [`BridgeError`] if the recording or the port cannot be used.
pub(super) async fn replay(options: &ReplayOptions) -> Result<ReplaySummary, BridgeError> {
    let mut shutdown = Shutdown::new()?;
    let unusable = |source| BridgeError::Recording(options.file.clone(), source);
    let Some(output) = &options.output else {
        return Err(BridgeError::Output("nothing".to_owned(), io::ErrorKind::InvalidInput.into()));
    };
    let unopened = |source| BridgeError::Output(output.to_string(), source);
    let pace = if options.fast { Pace::Fast } else { Pace::RealTime };
    let mut replayer = open(&options.file, pace)?;
    let mut port = ReplayPort::open(output).await.map_err(unopened)?;
    tracing::info!("playing at {output}");
    let spinner = ProgressBar::new_spinner();
    spinner.enable_steady_tick(TICK);
    let (mut buffer, mut outgoing) = (vec![0; 4096], Vec::new());
    let mut last_sent: Option<Instant> = None;
    loop {
        outgoing.extend(replayer.take());
        let ReplayCounts { codes, blocks, .. } = replayer.counts();
        spinner.set_message(format!("{codes} codes, {blocks} packed blocks"));
        if replayer.is_finished() {
            let since = last_sent.get_or_insert_with(Instant::now).elapsed();
            let is_read = outgoing.is_empty() && port.unread() == 0;
            if (is_read && since > LINGER) || since > DRAIN_TIMEOUT {
                break;
            }
        } else {
            last_sent = None;
        }
        let due = next_due(&replayer, outgoing.len());
        tokio::select! {
            transfer = port.exchange(&mut buffer, &outgoing) => match transfer.map_err(unopened)? {
                Transfer::Read(count) => replayer.receive(&buffer[..count]).map_err(unusable)?,
                Transfer::Written(count) => drop(outgoing.drain(..count)),
                Transfer::NotWritten(error) => return Err(unopened(error)),
            },
            () = sleep_until(due.unwrap_or_else(Instant::now)), if due.is_some() => {
                replayer.play(HostTime::now().monotonic_us).map_err(unusable)?;
            }
            () = sleep(TICK) => {}
            reason = shutdown.requested() => {
                tracing::info!("ending the replay: {reason}");
                break;
            }
        }
    }
    spinner.finish_and_clear();
    Ok(ReplaySummary { path: options.file.clone(), counts: replayer.counts() })
}

pub(crate) fn open(path: &Path, pace: Pace) -> Result<Replayer<File>, BridgeError> {
    let unusable = |source| BridgeError::Recording(path.to_owned(), source);
    let file = File::open(path).map_err(|error| unusable(RecordingError::Read(error)))?;
    Replayer::new(file, pace).map_err(unusable)
}

/// Shows a recording on a live page, until a signal ends the program.
///
/// # Errors
///
/// [`BridgeError`] if the recording or the page's address cannot be used.
pub(super) async fn show(
    options: ReplayOptions,
    ros: NodeOptions,
) -> Result<FinalCounts, BridgeError> {
    let feed = ReplayFeed::new(open(&options.file, Pace::RealTime)?, options.file);
    let header = feed.header();
    // Leave out features, because they are of no use without their classifier.
    let streams = header.streams.without(Streams::FEATURES);
    let mut topics = AnnouncedStream::TOPICS.into_iter().map(|(_, topic)| topic);
    let announced = topics.find(|topic| topic.is_in(streams));
    let publication = Publication {
        settings: Settings {
            mains_hz: header.mains_hz,
            announced: announced.unwrap_or_default(),
            streams,
            ..Settings::default()
        },
        model: options.model,
        upload_model: None,
        ros,
        topic_prefix: String::new(),
        get_info: GET_INFO_SERVICE,
        exclusions: Exclusions::default(),
        impedance: None,
        classifying: None,
        exit_at_end: false,
        realtime: false,
        record_dir: options.viewing.record_dir.clone(),
    };
    let page = LivePage::new("corticode-bridge", options.viewing);
    Box::pin(publication.show(feed, page)).await
}

/// Returns when to send the next frame. Returns `None` while nothing is played, and while
/// `waiting`, the number of bytes queued for the host, is at least [`MAX_WAITING`].
pub(crate) fn next_due(replayer: &Replayer<File>, waiting: usize) -> Option<Instant> {
    let now_us = HostTime::now().monotonic_us;
    let due_us = replayer.due_us(now_us).filter(|_| waiting < MAX_WAITING)?;
    let wait_us = u64::try_from(due_us.saturating_sub(now_us)).unwrap_or(0);
    Some(Instant::now() + Duration::from_micros(wait_us))
}

/// A port that the replay creates, to which one host at a time can connect.
#[derive(Debug)]
pub(crate) enum ReplayPort {
    Tty {
        port: Port,
        /// Symbolic link to the terminal; removed when the port is dropped.
        link: PathBuf,
        /// The terminal, kept open so that a host can close it and open it again.
        terminal: OwnedFd,
    },
    Tcp {
        listener: TcpListener,
        host: Option<Port>,
    },
}

impl ReplayPort {
    /// Creates a pseudoterminal with a link to it, or listens on a TCP port.
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
            PortAddress::Tcp(address) => {
                Ok(ReplayPort::Tcp { listener: TcpListener::bind(address).await?, host: None })
            }
        }
    }

    /// Waits until bytes from the host are read into `buffer` or a part of `outgoing` is written;
    /// if there is no host, waits for one. A host that disconnects is no error. Cancel safe.
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

    /// Returns the number of written bytes that the host has not read; on TCP always 0.
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
    // Remove the link only if it leads to a pseudoterminal: then an earlier run has left it behind.
    if std::fs::read_link(link).is_ok_and(|target| target.starts_with("/dev/pts")) {
        std::fs::remove_file(link)?;
    }
    symlink(name.to_str().map_err(io::Error::other)?, link)?;
    Ok(ReplayPort::Tty { port, link: link.to_owned(), terminal })
}
