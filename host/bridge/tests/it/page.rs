//! Commands of the live page, which a simulated board carries out.

use std::io::{BufReader, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use link::{AckResult, ExclusionPolicy, SelfTest, Streams, ToDevice};
use neuro_ros::{DiagnosticArray, DiagnosticStatus, NeuroFrame, Wire as _};
use rustix::process::Signal;
use serde_json::Value;

use crate::board::{Board, assert_has, electrode};
use crate::convert::{Table, convert};
use crate::device::Device;
use crate::process::{Bridge, TIMEOUT, free_address, wait_for_bytes, wait_until};
use crate::synthetic_recording::Rig;
use crate::viewer::{next, view};

const TOKEN: &str = "0123456789abcdef";

/// A bridge with a live page, which records to `folder`.
struct Page {
    bridge: Bridge,
    address: SocketAddr,
    folder: tempfile::TempDir,
}

impl Page {
    fn start(device: &Device, options: &[&str]) -> Page {
        Page::start_by(device, options, Bridge::start)
    }

    fn start_by(device: &Device, options: &[&str], start: impl Fn(&[&str]) -> Bridge) -> Page {
        let folder = tempfile::tempdir().unwrap();
        let address = free_address();
        let (at, records) = (address.to_string(), folder.path().to_str().unwrap().to_owned());
        let arguments = ["--port", &device.port, "--sink=view", "--view-token", TOKEN];
        let view = ["--view-address", &at, "--record-dir", &records];
        let bridge = start(&[&arguments[..], &view, options].concat());
        wait_until("the live page", || TcpStream::connect(address).is_ok());
        let page = Page { bridge, address, folder };
        page.wait_for("device", |status| status.message.starts_with("streaming"));
        page
    }

    /// Sends a command. Returns the status of the response and its body.
    fn command(&self, path: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        let (address, length) = (self.address, body.len());
        let request = format!(
            "POST /{path} HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\n\
             Authorization: Bearer {TOKEN}\r\nContent-Length: {length}\r\n\r\n{body}"
        );
        stream.write_all(request.as_bytes()).unwrap();
        let response = std::io::read_to_string(stream).unwrap();
        let (head, body) = response.split_once("\r\n\r\n").unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        (status, body.to_owned())
    }

    /// Sends a command that must be carried out. Returns the answer.
    #[track_caller]
    fn done(&self, path: &str, body: &str) -> Value {
        let (status, text) = self.command(path, body);
        assert_eq!(status, 200, "{path} {body}: {text}");
        serde_json::from_str(&text).unwrap()
    }

    /// Sends a command that must be refused. Returns the reason.
    #[track_caller]
    fn refused(&self, path: &str, body: &str) -> String {
        let (status, text) = self.command(path, body);
        assert_eq!(status, 409, "{path} {body}: {text}");
        text
    }

    /// Waits for a report in which `wanted` is true for the status `name`.
    fn wait_for(&self, name: &str, wanted: impl Fn(&DiagnosticStatus) -> bool) {
        let name = format!("corticode: {name}");
        let mut reader = self.view();
        loop {
            let report = DiagnosticArray::from_bytes(&next(&mut reader, 5)).unwrap();
            if report.status.iter().any(|one| one.name == name && wanted(one)) {
                return;
            }
        }
    }

    fn view(&self) -> BufReader<TcpStream> {
        view(self.address)
    }

    /// Returns the only file in the folder for recordings.
    fn recording(&self) -> PathBuf {
        let mut files = std::fs::read_dir(self.folder.path()).unwrap();
        files.next().unwrap().unwrap().path()
    }
}

fn value<'s>(status: &'s DiagnosticStatus, key: &str) -> &'s str {
    let mut values = status.values.iter();
    values.find(|one| one.key == key).map_or("", |one| &one.value)
}

#[test]
fn a_recording_begun_while_the_device_streams_is_converted_without_a_gap() {
    let device = Device::tcp(Board::new());
    let options = ["--streams=codes,raw,filtered,events"];
    let page = Page::start(&device, &options);
    let message = page.done("record", "start")["message"].to_string();
    assert!(message.contains("recording to "), "{message}");
    assert!(page.refused("record", "start").contains("is being recorded already"));
    let path = page.recording();
    wait_for_bytes(&path, 300_000);
    let marked = page.done("marker", "eyes closed");
    assert_eq!(marked["published"], true);
    page.wait_for("recording", |status| {
        value(status, "markers") == "1"
            && value(status, "bytes lost") == "0"
            && value(status, "disk left bytes").parse::<u64>().unwrap_or(0) > 0
            && path.ends_with(value(status, "file"))
    });
    let bytes = std::fs::metadata(&path).unwrap().len();
    wait_for_bytes(&path, bytes + 300_000);
    let ended = page.done("record", "stop")["message"].to_string();
    assert_has(&ended, ["1 markers, 0 bytes lost", "s, "]);
    assert_eq!(page.refused("record", "stop"), "nothing is being recorded");
    // The stream has gone on, and a second recording has a file of its own.
    page.done("record", "start");
    page.bridge.end(Signal::TERM);
    assert_eq!(std::fs::read_dir(page.folder.path()).unwrap().count(), 2);

    let log = convert(&path, "csv").success();
    assert_has(&log, [" lost 0 (bursts 0", "frames: lost 0 crc 0"]);
    for stream in ["codes", "raw", "filtered"] {
        let table = Table::read(&path.with_extension(format!("{stream}.csv")));
        assert!(table.rows.len() > 20, "{stream}");
        let fillers = (0..table.rows.len()).filter(|row| table.is_filler(*row));
        assert_eq!(fillers.count(), 0, "fillers in {stream}");
        let places = markers(&table);
        assert_eq!(places.len(), 1, "markers in {stream}");
        let place = places[0] * 100 / table.rows.len();
        assert!((20..80).contains(&place), "marker at {place} % of {stream}");
    }
    is_shown_again(&path);
}

/// Returns the rows with markers.
fn markers(table: &Table) -> Vec<usize> {
    let mut rows = table.events();
    rows.retain(|row| {
        let mut codes = table.text(*row, "events").split(';');
        codes.any(|code| code == "32517")
    });
    rows.dedup();
    rows
}

#[test]
fn a_marker_is_converted_although_no_events_were_streamed() {
    let device = Device::tcp(Board::new());
    let page = Page::start(&device, &["--streams=codes"]);
    page.done("record", "start");
    let path = page.recording();
    wait_for_bytes(&path, 5_000);
    assert_eq!(page.done("marker", "now")["published"], false);
    wait_for_bytes(&path, 10_000);
    page.bridge.end(Signal::TERM);
    convert(&path, "csv").success();
    let table = Table::read(&path.with_extension("codes.csv"));
    assert_eq!(markers(&table).len(), 1);
}

/// Shows the recording at `path` on a live page. Returns the bridge and the page's messages.
fn shown(path: &Path) -> (Bridge, BufReader<TcpStream>) {
    let address = free_address();
    let (file, at) = (path.to_str().unwrap(), address.to_string());
    let options = ["replay", file, "--live", "--view-address", &at];
    let bridge = Bridge::start(&[&options[..], &["--view-token", TOKEN]].concat());
    wait_until("the live page", || TcpStream::connect(address).is_ok());
    (bridge, view(address))
}

/// Asserts that a live page shows the recording at `path` from its beginning, without a loss.
fn is_shown_again(path: &Path) {
    let (bridge, mut page) = shown(path);
    let mut last = 0;
    for _ in 0..20 {
        let frame = NeuroFrame::from_bytes(&next(&mut page, 1)).unwrap();
        let [flags, window, _, _, _, _, lost, _] = frame.tri.data[..] else {
            panic!("{:?}", frame.tri.data);
        };
        assert_eq!((flags & 0x8000, lost), (0, 0), "{frame:?}");
        assert!(window < 200 && (last == 0 || window == last + 1), "{last}, {window}");
        last = window;
    }
    bridge.end(Signal::TERM);
}

#[test]
fn a_recording_of_samples_alone_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("raw.wire");
    let mut rig = Rig::with(Streams::RAW, 1, 0);
    rig.run(100, 200);
    std::fs::write(&path, rig.finish()).unwrap();
    let (bridge, mut page) = shown(&path);
    // Skip the first frame, whose samples the simulated board does not send.
    next(&mut page, 4);
    // Electrode 0 rises by a count in every sample, and a frame has 32 samples.
    let mut last = None;
    for _ in 0..10 {
        let frame = NeuroFrame::from_bytes(&next(&mut page, 4)).unwrap();
        let counts = (frame.eeg.data[0] / 0.022_351_742).round();
        assert_eq!(frame.tri.data[0], 0, "flags");
        let follows = last.is_none_or(|last: f32| (counts - last - 32.0).abs() < 0.5);
        assert!(follows, "{last:?}, {counts}");
        last = Some(counts);
    }
    bridge.end(Signal::TERM);
}

#[test]
fn a_full_disk_ends_the_recording_and_not_the_stream() {
    let device = Device::tcp(Board::new());
    let start = |arguments: &[&str]| Bridge::start_on_full_disk(arguments, Stdio::null());
    let page = Page::start_by(&device, &["--streams=codes,raw"], start);
    page.done("record", "start");
    page.wait_for("recording", |status| {
        status.level == neuro_ros::DiagnosticLevel::Error
            && status.message.contains("File too large")
            && status.message.contains("what was written stays")
    });
    let mut view = page.view();
    let seq = |body: Vec<u8>| NeuroFrame::from_bytes(&body).unwrap().neuroheader.seq;
    let first = seq(next(&mut view, 1));
    for step in 1..20 {
        assert_eq!(seq(next(&mut view, 1)), first + step);
    }
    assert!(std::fs::metadata(page.recording()).unwrap().len() >= 16_384);
    page.bridge.end(Signal::TERM);
}

#[test]
fn a_folder_that_does_not_exist_is_refused_with_the_option_that_names_it() {
    let device = Device::tcp(Board::new());
    let page = Page::start(&device, &[]);
    std::fs::remove_dir(page.folder.path()).unwrap();
    let why = page.refused("record", "start");
    assert_has(&why, ["cannot be created", "--record-dir"]);
}

/// Returns the newest command to the device, except commands that only state the time.
fn last_command(device: &Device) -> Option<ToDevice<'static>> {
    let mut received = device.received();
    received.retain(|command| !matches!(command, ToDevice::SyncTime { .. }));
    received.pop()
}

#[test]
fn a_self_test_needs_a_stopped_device_and_its_table_is_the_answer() {
    let device = Device::tcp(Board { self_test: Some(SelfTest::default()), ..Board::new() });
    let page = Page::start(&device, &[]);
    assert!(page.refused("self-test", "").contains("stop it first"));
    assert_eq!(page.done("stop", "")["message"], "the device is stopped");
    assert_eq!(last_command(&device), Some(ToDevice::Stop));
    let tested = page.done("self-test", "");
    assert_eq!(tested["report"]["device"]["board"], "board");
    assert!(tested["message"].as_str().unwrap().contains("not measured"));
    assert_eq!(last_command(&device), Some(ToDevice::SelfTest));
    assert_eq!(page.done("start", "")["message"], "the device streams");
    page.bridge.end(Signal::TERM);

    let device = Device::tcp(Board::answering(AckResult::NotSupported));
    let page = Page::start(&device, &[]);
    page.done("stop", "");
    assert!(page.refused("self-test", "").contains("no converters"));
}

#[test]
fn electrodes_and_rates_are_set_on_the_device() {
    let device = Device::tcp(Board::new());
    let page = Page::start(&device, &["--streams=codes,packed,events"]);
    let label = electrode(2);
    let policy =
        |always, never| ToDevice::SetExclusion(ExclusionPolicy { always, never, automatic: true });
    for (decision, always, never) in [("always", 4, 0), ("never", 0, 4), ("automatic", 0, 0)] {
        let done = page.done("exclude", &format!("{} {decision}", label.to_lowercase()));
        assert!(done["message"].as_str().unwrap().starts_with(&label));
        assert_eq!(last_command(&device), Some(policy(always, never)));
    }
    let unknown = page.refused("exclude", "Xy9 always");
    assert_has(&unknown, ["no electrode Xy9", &label]);
    page.done("rate", "7");
    assert_eq!(device.rates().last(), Some(&7));
    assert!(page.refused("rate", "16").contains("0 (finest) to 15"));
    page.bridge.end(Signal::TERM);

    let device = Device::tcp(Board::answering(AckResult::NotSupported));
    let page = Page::start(&device, &["--streams=codes"]);
    let why = page.refused("exclude", &format!("{label} always"));
    assert!(why.contains("its board or model cannot do that"), "{why}");
    assert!(page.refused("rate", "7").contains("--streams packed"));
    // Without the stream of events and without a recording, a marker would be lost, so it is
    // refused.
    assert!(page.refused("marker", "now").contains("start a recording first"));
    page.done("record", "start");
    let marked = page.done("marker", "now");
    assert_eq!(marked["published"], false);
}
