//! Sessions of the virtual board with each kind of output.

use std::{
    fs::{File, OpenOptions},
    io::Read,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use host_sim::{
    Faults, FileRules, Identity, Output, Pace, RecordedEdges, Report, Session, SessionError,
    Source,
    synthetic::{Generator, SyntheticSpec},
};
use link::{Decoder, MAX_FRAME, Streams, ToDevice, ToHost};
use pipeline::Mains;
use rustix::fs::{CWD, Mode, mkfifoat};
use rustix::pipe::fcntl_setpipe_size;

use crate::program::{TIMEOUT, connect, eventually, free_address, send, start};

fn session(output: Output, pace: Pace, seconds: Option<u64>) -> Session {
    Session {
        output,
        file_rules: FileRules::default(),
        streams: Streams::CODES,
        pace,
        clock_ppm: 0.0,
        mains: Mains::Hz50,
        identity: Identity { session_id: 1, chip_uid: [0; 12], ..Identity::default() },
        limit: seconds.map(|seconds| 512 * seconds),
        faults: Faults::default(),
        trigger: None,
        contacts: Vec::new(),
        recorded_edges: RecordedEdges::default(),
    }
}

fn run(session: &Session, stop: &AtomicBool) -> Result<Report, SessionError> {
    run_observed(session, stop, |_, _| ())
}

fn run_observed(
    session: &Session,
    stop: &AtomicBool,
    on_second: impl FnMut(&link::Stats, u64),
) -> Result<Report, SessionError> {
    let spec = SyntheticSpec::new(1, model::LABELS.split(' '));
    let generator = Generator::new(&spec).expect("the default specification");
    session.run(&mut Source::Synthetic(Box::new(generator)), stop, on_second)
}

/// A run in a separate thread. Dropping the value stops the run.
struct Running {
    stop: Arc<AtomicBool>,
    /// Number of codes that the board had made at the last full second of signal.
    codes: Arc<AtomicU32>,
    thread: Option<JoinHandle<Result<Report, SessionError>>>,
}

impl Running {
    fn start(session: Session) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let codes = Arc::new(AtomicU32::new(0));
        let (flag, count) = (stop.clone(), codes.clone());
        let on_second =
            move |stats: &link::Stats, _| count.store(stats.codes_made, Ordering::Relaxed);
        let thread = thread::spawn(move || run_observed(&session, &flag, on_second));
        Self { stop, codes, thread: Some(thread) }
    }

    fn finish(mut self) -> Report {
        self.stop.store(true, Ordering::Relaxed);
        let thread = self.thread.take().expect("finished once");
        thread.join().expect("no panic").expect("no error")
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn open_terminal(link: &Path) -> File {
    eventually(|| OpenOptions::new().read(true).write(true).open(link).ok())
}

/// Reads until `count` codes have arrived and returns their window indices.
fn read_codes(port: &mut impl Read, count: usize) -> Vec<u32> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut windows = Vec::new();
    let mut buffer = [0; 256];
    while windows.len() < count {
        let length = port.read(&mut buffer).expect("the board's port is open");
        assert!(length > 0, "the port ended after {} codes", windows.len());
        let mut bytes = &buffer[..length];
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut bytes) {
            windows.extend(outcome.ok().and_then(|frame| match frame.message {
                ToHost::Code(code) => Some(code.window),
                _ => None,
            }));
        }
    }
    windows
}

const START: ToDevice<'_> = start(Streams::CODES);

#[test]
fn a_file_on_a_slow_disk_gets_every_code() {
    let folder = folder();
    let path = folder.path().join("pipe");
    mkfifoat(CWD, &path, Mode::RWXU).expect("a pipe");
    let output = Output::File(path.clone());
    let reader = thread::spawn(move || {
        let mut pipe = File::open(path).expect("the pipe");
        // Make the pipe as small as possible, so that the run ends while frames still wait for the
        // reader.
        fcntl_setpipe_size(&pipe, 4_096).expect("a page");
        thread::sleep(Duration::from_secs(5));
        let mut bytes = Vec::new();
        pipe.read_to_end(&mut bytes).expect("the board closes it");
        bytes
    });
    let session = session(output, Pace::Fast, Some(3));
    let report = run(&session, &AtomicBool::new(false)).expect("a slow disk is no error");
    let bytes = reader.join().expect("no panic");
    let codes = report.stats.codes_made;
    let windows = read_codes(&mut &bytes[..], codes as usize);
    assert_eq!(windows, (0..codes).collect::<Vec<_>>());
    assert_eq!(report.stats.frames_dropped, 0);
}

#[test]
fn a_terminal_can_be_closed_and_opened_again() {
    let folder = folder();
    let link = folder.path().join("board");
    let running = Running::start(session(Output::Pty(link.clone()), Pace::Realtime, None));
    let mut terminal = open_terminal(&link);
    send(&mut terminal, 0, START);
    assert_eq!(read_codes(&mut terminal, 3)[..3], [0, 1, 2]);
    drop(terminal);

    let mut terminal = open_terminal(&link);
    let windows = read_codes(&mut terminal, 3);
    assert!(windows[0] >= 3 && windows[2] == windows[0] + 2, "{windows:?}");
    send(&mut terminal, 0, ToDevice::Stop);
    running.finish();
    assert!(!link.exists(), "the board removes its link");
}

#[test]
fn a_board_without_a_reader_counts_its_codes_as_dropped_and_stops_on_request() {
    let folder = folder();
    let link = folder.path().join("board");
    let running = Running::start(session(Output::Pty(link.clone()), Pace::Fast, None));
    let mut terminal = open_terminal(&link);
    send(&mut terminal, 0, START);
    // Wait until the board makes no more codes, because the terminal and the queue are full.
    let mut codes = 0;
    eventually(|| {
        thread::sleep(Duration::from_secs(1));
        let before = std::mem::replace(&mut codes, running.codes.load(Ordering::Relaxed));
        (codes > 32 && codes == before).then_some(())
    });
    let start = Instant::now();
    let report = running.finish();
    assert!(start.elapsed() < TIMEOUT);
    // All frames count as dropped, except about half a second of frames that the terminal holds.
    let stats = report.stats;
    assert!(stats.frames_dropped > stats.codes_made / 2, "{report:?}");
    assert!(stats.codes_made < 200, "{report:?}");
}

#[test]
fn a_second_host_replaces_the_first_and_virtual_time_waits_for_it() {
    let address = free_address();
    let running = Running::start(session(Output::Tcp(address.clone()), Pace::Fast, None));
    let mut first = connect(&address);
    send(&mut first, 0, START);
    assert_eq!(read_codes(&mut first, 2)[..2], [0, 1]);
    drop(first);
    let mut second = connect(&address);
    assert!(read_codes(&mut second, 20).windows(2).all(|pair| pair[1] == pair[0] + 1));
    running.finish();
}
