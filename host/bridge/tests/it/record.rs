//! The subcommand `record`: files of a killed program, a full disk, and an existing file.

use std::fs::File;
use std::path::Path;
use std::process::Stdio;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use capture::{LeftOut, RecordKind, RecordingReader};
use link::{Decoder, MAX_FRAME, Streams, ToDevice, ToHost};
use rustix::process::Signal;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::process::{Bridge, wait_for_bytes};

/// What the tests check in a recording.
#[derive(Debug, Default)]
pub(crate) struct Content {
    windows: Vec<u32>,
    /// Dequantised values of the codes; the simulated board has scale 0.5 and zero point 1.
    pub(crate) codes: Vec<Vec<f64>>,
    events: u32,
    kinds: Vec<RecordKind>,
    left_out: LeftOut,
}

/// Reads a recording, and asserts that every received frame in it is intact.
pub(crate) fn read(path: &Path) -> Content {
    let mut content = Content::default();
    let mut reader = RecordingReader::new(File::open(path).unwrap()).unwrap();
    let mut decoder = Decoder::<MAX_FRAME>::new();
    while let Some(record) = reader.next_record().unwrap() {
        content.kinds.push(record.kind);
        if record.kind != RecordKind::Received {
            continue;
        }
        let mut bytes = record.payload;
        let frame = decoder.next::<ToHost>(&mut bytes).unwrap();
        assert!(bytes.is_empty(), "one record holds one frame");
        match frame.unwrap().message {
            ToHost::Code(code) => {
                let z = code.values.levels().map(|level| f64::from(level - 1) * 0.5);
                content.codes.push(z.collect());
                content.windows.push(code.window);
            }
            ToHost::Event(_) => content.events += 1,
            _ => {}
        }
    }
    content.left_out = reader.left_out();
    content
}

/// Starts to record the device to the file at `path`, with `more` arguments.
fn start(device: &Device, path: &Path, more: &[&str]) -> Bridge {
    let arguments = ["record", path.to_str().unwrap(), "--port", &device.port];
    Bridge::start(&[&arguments[..], more].concat())
}

#[test]
fn a_recording_holds_every_code_and_ends_with_a_summary() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    let device = Device::tcp(Board::new());
    let bridge = start(&device, &path, &["--packed-rate=3"]);
    wait_for_bytes(&path, 20_000);
    let log = bridge.end(Signal::INT);
    let made = device.controls.made.load(Relaxed);
    let received = format!("received {made} lost 0");
    assert_has(&log, [&received, "--packed-rate has no effect"]);
    let content = read(&path);
    assert!(content.windows.iter().copied().eq(0..made), "{content:?}");
    assert_eq!(content.events, made / 10);
    assert_eq!(content.left_out, LeftOut::default());
    assert_eq!(content.kinds[0], RecordKind::Opened);
    assert!(content.kinds.contains(&RecordKind::Ending));
}

#[test]
fn a_recording_that_was_killed_is_readable_to_its_last_whole_frame() {
    let folder = tempfile::tempdir().unwrap();
    let mut codes = 0;
    for round in 0..100_u64 {
        let path = folder.path().join(format!("recording-{round}"));
        let device = Device::tcp(Board::new());
        let bridge = start(&device, &path, &[]);
        // The recording starts with a header of 28 bytes. Each round kills the bridge at another
        // time after the header.
        wait_for_bytes(&path, 28);
        std::thread::sleep(Duration::from_micros(round * 7_919 % 150_000));
        bridge.signal(Signal::KILL);
        bridge.wait();
        let content = read(&path);
        assert_eq!(content.left_out.within, 0);
        let recorded = u32::try_from(content.windows.len()).unwrap();
        assert!(content.windows.iter().copied().eq(0..recorded), "{content:?}");
        codes += recorded;
    }
    assert!(codes > 100, "only {codes} codes in 100 rounds");
}

#[test]
fn an_existing_file_is_refused_and_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    std::fs::write(&path, "mine").unwrap();
    let device = Device::tcp(Board::new());
    let log = start(&device, &path, &[]).failure(2);
    assert_has(&log, ["exists already", "--force"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"mine");
    let log = start(&device, &folder.path().join("no/recording"), &[]).failure(2);
    assert!(log.contains("cannot be created"), "{log}");
}

#[test]
fn force_replaces_a_file_and_a_killed_recording_has_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    std::fs::write(&path, [0xff; 1000]).unwrap();
    let device = Device::tcp(Board::new());
    let bridge = start(&device, &path, &["--force"]);
    wait_for_bytes(&path, 20_000);
    bridge.signal(Signal::KILL);
    bridge.wait();
    let content = read(&path);
    assert!(content.windows.len() > 10, "{content:?}");
    assert_eq!(content.left_out.within, 0);
}

#[test]
fn a_full_disk_ends_the_recording_and_keeps_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording");
    let device = Device::tcp(Board::new());
    let arguments = ["record", path.to_str().unwrap(), "--port", &device.port];
    let log = Bridge::start_on_full_disk(&arguments, Stdio::null()).failure(1);
    assert_has(&log, ["cannot be written any further", "File too large"]);
    let content = read(&path);
    let length = std::fs::metadata(&path).unwrap().len();
    assert!(length.is_multiple_of(512) && length >= 16_384, "{length}");
    assert!(content.left_out.at_end < 2_100, "{content:?}");
    assert!(content.windows.len() > 40, "{content:?}");
}

#[test]
fn packed_blocks_have_the_models_rate_unless_the_device_has_another_model() {
    for (model_id, rates) in [(Board::new().model_id, vec![4]), ([9; 8], vec![])] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recording");
        let device = Device::tcp(Board { model_id, rate: 9, ..Board::new() });
        let recorder = start(&device, &path, &["--streams=packed"]);
        wait_for_bytes(&path, 20_000);
        let log = recorder.end(Signal::TERM);
        let received = device.received();
        assert_eq!(device.rates(), rates, "{log}");
        // The first `Start` follows two other commands, and the command that sets the rate, if any.
        let start = |command: &ToDevice| matches!(command, ToDevice::Start(start) if start.streams == Streams::PACKED);
        let start = received.iter().position(start).unwrap();
        assert_eq!(received[..start].len(), 2 + rates.len(), "{received:?}");
    }
}
