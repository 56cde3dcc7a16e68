//! A simulated board on a TCP port or a pseudoterminal, which runs in real time.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use link::{
    Audit, BlockForm, CodeValues, CompressedRaw, Event, EventKind, Filtered, Flags, Raw, Streams,
    ToDevice, ToHost,
};
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use crate::board::Board;

/// Time between two codes. It is shorter than the 62.5 ms of a real board, to keep the tests short.
pub(crate) const PACE: Duration = Duration::from_millis(20);

/// What a test sets and reads while a board runs; shared with the board's thread.
#[derive(Default)]
pub(crate) struct Controls {
    /// Number of codes that the board skips next, as in a long outage.
    pub(crate) jump: AtomicU32,
    /// Whether a byte of every third code is changed on its way to the host.
    pub(crate) damage: AtomicBool,
    /// Set by a test to close the connection a single time; the board keeps running.
    pub(crate) hang_up: AtomicBool,
    /// Number of codes made so far.
    pub(crate) made: AtomicU32,
    /// Whether the board accepts no new connection.
    pub(crate) unplugged: AtomicBool,
    /// Whether the board is suspended. After the suspension, it makes the missed codes at once.
    pub(crate) stand_still: AtomicBool,
    stop: AtomicBool,
    received: Mutex<Vec<ToDevice<'static>>>,
}

/// A simulated board on a port, run by a thread.
pub(crate) struct Device {
    pub(crate) port: String,
    pub(crate) controls: Arc<Controls>,
    thread: Option<JoinHandle<()>>,
}

impl Device {
    /// Runs the board on a free TCP port.
    pub(crate) fn tcp(board: Board) -> Device {
        let listener = TcpListener::bind(SocketAddr::from(([127, 0, 0, 1], 0))).unwrap();
        let port = format!("tcp:{}", listener.local_addr().unwrap());
        listener.set_nonblocking(true).unwrap();
        Device::start(port, board, None, move || {
            let (stream, _) = listener.accept()?;
            stream.set_nonblocking(true)?;
            Ok(Box::new(stream) as Box<dyn Line>)
        })
    }

    /// Runs the board on a pseudoterminal whose name changes with every connection. The symbolic
    /// link `path` leads to the current pseudoterminal.
    pub(crate) fn pty(board: Board, path: &Path) -> Device {
        let port = path.display().to_string();
        let path = path.to_owned();
        Device::start(port, board, Some(path.clone()), move || {
            let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
            let pty = openpt(flags)?;
            grantpt(&pty)?;
            unlockpt(&pty)?;
            fcntl_setfl(&pty, OFlags::NONBLOCK)?;
            let name = ptsname(&pty, Vec::new())?;
            std::os::unix::fs::symlink(name.to_str().map_err(io::Error::other)?, &path)?;
            Ok(Box::new(std::fs::File::from(pty)) as Box<dyn Line>)
        })
    }

    fn start(
        port: String,
        mut board: Board,
        link: Option<PathBuf>,
        mut plug_in: impl FnMut() -> io::Result<Box<dyn Line>> + Send + 'static,
    ) -> Device {
        let controls = Arc::new(Controls::default());
        let shared = Arc::clone(&controls);
        let thread = std::thread::spawn(move || {
            let mut next_code = Instant::now();
            let start = Instant::now();
            let mut line = None;
            while !shared.stop.load(Relaxed) {
                if shared.stand_still.load(Relaxed) {
                    sleep(PACE);
                    continue;
                }
                if shared.hang_up.load(Relaxed) {
                    line = None;
                    // Remove the symbolic link, because another program may be given a
                    // pseudoterminal with this name. Then tell the test that the link is gone.
                    link.as_ref().map(std::fs::remove_file);
                    shared.hang_up.store(false, Relaxed);
                }
                if line.is_none() && !shared.unplugged.load(Relaxed) {
                    line = plug_in().ok();
                }
                let now = Instant::now();
                if board.streaming && now >= next_code {
                    next_code += PACE;
                    let device_us = u64::try_from(start.elapsed().as_micros()).unwrap();
                    board.next_window += shared.jump.swap(0, Relaxed);
                    let mut bytes = board.code(device_us, 3);
                    if shared.damage.load(Relaxed) && board.next_window.is_multiple_of(3) {
                        bytes[20] ^= 1;
                    }
                    bytes.extend(side_messages(&mut board, device_us));
                    shared.made.store(board.next_window, Relaxed);
                    send(&mut line, &bytes);
                }
                let mut buffer = [0; 1024];
                match line.as_mut().map(|line| line.read(&mut buffer)) {
                    Some(Ok(count)) if count > 0 => {
                        let seen = board.received.len();
                        let streaming = board.streaming;
                        let answers = board.answer(&buffer[..count]);
                        let new = board.received[seen..].iter().map(|(_, command)| *command);
                        if board.streaming && !streaming {
                            next_code = Instant::now();
                        }
                        shared.received.lock().unwrap().extend(new);
                        send(&mut line, &answers);
                    }
                    Some(Err(error)) if is_not_ready(&error) => {}
                    Some(_) => line = None,
                    None => {}
                }
                sleep(Duration::from_millis(1));
            }
        });
        Device { port, controls, thread: Some(thread) }
    }

    /// Returns the commands that the board received, oldest first.
    pub(crate) fn received(&self) -> Vec<ToDevice<'static>> {
        self.controls.received.lock().unwrap().clone()
    }

    /// Returns the rates of the packed code that the board was told to use, oldest first.
    pub(crate) fn rates(&self) -> Vec<u8> {
        let received = self.received();
        let rates = received.iter().filter_map(|command| match command {
            ToDevice::SetRate { rate } => Some(*rate),
            _ => None,
        });
        rates.collect()
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.controls.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Returns the messages that the board sends beside its newest code: samples and steps, and with
/// every tenth code an edge of the trigger and an audit, all of them only if requested.
fn side_messages(board: &mut Board, device_us: u64) -> Vec<u8> {
    let window = board.next_window - 1;
    let streams = board.streams;
    let mut bytes = Vec::new();
    for part in 0..4 {
        let raw = Raw {
            first_sample: u64::from(window) * 32 + part * 8,
            channels: 64,
            flags: Flags::empty(),
            counts: &[1; 8 * 64 * 3],
        };
        if streams.contains(Streams::RAW) {
            bytes.extend(board.frame(device_us, &ToHost::Raw(raw)));
        }
        if streams.contains(Streams::COMPRESSED_RAW) {
            let compressed = CompressedRaw {
                first_sample: raw.first_sample,
                channels: raw.channels,
                flags: raw.flags,
                form: BlockForm::Verbatim,
                samples: 8,
                bytes: raw.counts,
            };
            bytes.extend(board.frame(device_us, &ToHost::CompressedRaw(compressed)));
        }
    }
    for part in 0..2 {
        let filtered = Filtered {
            first_step: u64::from(window) * 8 + part * 4,
            electrodes: 61,
            fraction_bits: 5,
            flags: Flags::empty(),
            values: &[2; 4 * 61 * 4],
        };
        if streams.contains(Streams::FILTERED) {
            bytes.extend(board.frame(device_us, &ToHost::Filtered(filtered)));
        }
    }
    if window % 10 == 9 && streams.contains(Streams::EVENTS) {
        let event = Event {
            kind: EventKind::TriggerRise,
            number: window / 10,
            sample: u64::from(window) * 32,
        };
        bytes.extend(board.frame(device_us, &ToHost::Event(event)));
    }
    if window % 10 == 9 && streams.contains(Streams::AUDIT) {
        let audit = Audit {
            model_id: board.model_id,
            window,
            planes: &[7; 1440],
            values: CodeValues::int8(&[3; 128]),
        };
        bytes.extend(board.frame(device_us, &ToHost::Audit(audit)));
    }
    bytes
}

trait Line: Read + Write + Send {}

impl<T: Read + Write + Send> Line for T {}

/// Returns whether an error means only that no bytes can be moved at present. EIO (5) means that no
/// program has opened the other end of the pseudoterminal.
fn is_not_ready(error: &io::Error) -> bool {
    error.kind() == ErrorKind::WouldBlock || error.raw_os_error() == Some(5)
}

/// Sends bytes as a board does, without waiting: what the host does not read in time is dropped.
fn send(line: &mut Option<Box<dyn Line>>, bytes: &[u8]) {
    if let Some(open) = line
        && let Err(error) = open.write_all(bytes)
        && !is_not_ready(&error)
    {
        *line = None;
    }
}
