//! Recordings with impossible times and indices, as from a damaged disk or a malicious sender.

use std::io::Cursor;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bridge_core::{HostTime, Model};
use capture::{Conversion, FileFormat, Pace, RecordKind, Recorder, RecordingReader, Replayer};
use link::{Decoder, MAX_FRAME, Start, Streams, ToDevice, ToHost};
use proptest::prelude::*;

use crate::board::assert_has;
use crate::synthetic_recording::Rig;

/// Longest time that a conversion may take. On an idle machine it takes milliseconds.
const TIMEOUT: Duration = Duration::from_mins(1);

/// Limit of the total size of a conversion's files, bytes: twice the 30 MB that they have with 122
/// s of fillers in each stream.
const MAX_BYTES: u64 = 60_000_000;

fn good() -> Vec<u8> {
    let mut rig = Rig::new(0);
    rig.run(32, 8);
    rig.finish()
}

/// Returns a valid recording that `change` has changed. `change` receives the number and the time
/// of each record, and, if the record is a frame from the device, the device time and the message
/// of that frame.
fn changed(
    mut change: impl FnMut(usize, &mut HostTime, Option<(&mut u64, &mut ToHost<'_>)>),
) -> Vec<u8> {
    let mut reader = RecordingReader::new(Cursor::new(good())).unwrap();
    let mut recorder = Recorder::new(*reader.header());
    let mut number = 0;
    while let Some(record) = reader.next_record().unwrap() {
        let (mut time, mut decoder) = (record.time, Decoder::<MAX_FRAME>::new());
        let mut payload = record.payload;
        match record.kind {
            RecordKind::Received => {
                let frame = decoder.next::<ToHost>(&mut payload).unwrap().unwrap();
                let (mut header, mut message) = (frame.header, frame.message);
                let fields = (&mut header.device_time_us, &mut message);
                change(number, &mut time, Some(fields));
                let mut buffer = [0; MAX_FRAME];
                let bytes = link::encode(&header, &message, &mut buffer).unwrap();
                recorder.received(bytes, time);
            }
            kind => {
                change(number, &mut time, None);
                match kind {
                    RecordKind::Opened => recorder.opened(time),
                    RecordKind::Closed => recorder.closed(time),
                    RecordKind::Sent => recorder.sent(record.payload, time),
                    _ => recorder.ending(time),
                }
            }
        }
        number += 1;
    }
    recorder.take()
}

/// Returns a replay to which a host has sent `Start`; `None` if the recording cannot be replayed.
fn started(recording: Vec<u8>, pace: Pace) -> Option<Replayer<Cursor<Vec<u8>>>> {
    let mut replayer = Replayer::new(Cursor::new(recording), pace).ok()?;
    let start = ToDevice::Start(Start {
        streams: Streams::CODES | Streams::RAW | Streams::FILTERED | Streams::EVENTS,
        mains_hz: 0,
    });
    let header = link::Header { version: link::VERSION, seq: 0, device_time_us: 0 };
    let mut buffer = [0; MAX_FRAME];
    let bytes = link::encode(&header, &start, &mut buffer).unwrap();
    replayer.receive(bytes).unwrap();
    Some(replayer)
}

/// Plays a whole recording as fast as the host reads. Returns the number of codes sent.
fn replay(recording: Vec<u8>) -> u64 {
    let mut replayer = started(recording, Pace::Fast).unwrap();
    while !replayer.is_finished() {
        replayer.play(1_000).unwrap();
        replayer.take();
    }
    replayer.counts().codes
}

/// Converts a recording, and asserts that the time and the size of the files stay within limits.
/// Returns the summary as text.
fn convert(recording: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.wire");
    std::fs::write(&path, recording).unwrap();
    let begin = Instant::now();
    let conversion = Conversion { file: path, to: FileFormat::Gdf, force: false, classifier: None };
    let model = Arc::new(Model::embedded().unwrap());
    let log = capture::convert(&conversion, model, |file, _| file).unwrap().to_string();
    assert!(begin.elapsed() < TIMEOUT, "{log}");
    let files = folder.path().read_dir().unwrap();
    let bytes: u64 = files.map(|file| file.unwrap().metadata().unwrap().len()).sum();
    assert!(bytes < MAX_BYTES, "{bytes} bytes: {log}");
    log
}

#[test]
fn a_record_with_an_impossible_time_is_left_out() {
    for monotonic_us in [i64::MAX, i64::MIN, 1 << 62, -1] {
        let recording = changed(|number, time, _| {
            if number == 60 {
                time.monotonic_us = monotonic_us;
            }
        });
        let log = convert(&recording);
        assert_has(&log, ["the recording is damaged: "]);
        assert!(replay(recording) > 25);
    }
    let recording = changed(|number, time, _| {
        if number == 60 {
            time.wall_ns = i64::MIN;
        }
    });
    assert!(convert(&recording).contains("the recording is damaged: "));
}

#[test]
fn a_pause_of_many_days_in_a_recording_takes_no_time() {
    let recording = changed(|number, time, _| {
        if number >= 60 {
            time.monotonic_us += 300 * 86_400 * 1_000_000;
        }
    });
    let log = convert(&recording);
    assert!(!log.contains("damaged"), "{log}");
}

#[test]
fn an_impossible_index_is_a_gap_that_is_filled_in_part_and_counted() {
    let mut done = [false; 3];
    let recording = changed(|number, _, message| {
        let Some((_, message)) = message.filter(|_| number > 60) else {
            return;
        };
        match message {
            ToHost::Raw(raw) if !done[0] => {
                raw.first_sample = 1 << 60;
                done[0] = true;
            }
            ToHost::Filtered(filtered) if !done[1] => {
                filtered.first_step = 1 << 60;
                done[1] = true;
            }
            ToHost::Code(code) if !done[2] => {
                code.window += 1 << 30;
                done[2] = true;
            }
            _ => {}
        }
    });
    assert_eq!(done, [true; 3]);
    let log = convert(&recording);
    assert_has(&log, [" missing rows are not filled: "]);
    replay(recording);
}

#[test]
fn an_impossible_device_time_of_an_event_is_no_panic() {
    for impossible_us in [u64::MAX, i64::MAX.unsigned_abs(), 1 << 62] {
        let mut events = 0;
        let recording = changed(|_, _, message| {
            if let Some((device_us, ToHost::Event(_))) = message {
                *device_us = impossible_us;
                events += 1;
            }
        });
        assert!(events > 0);
        convert(&recording);
        replay(recording);
    }
}

fn extreme() -> impl Strategy<Value = i64> {
    prop_oneof![Just(i64::MIN), Just(i64::MAX), any::<i64>()]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn a_replay_of_any_times_ends(
        places in prop::collection::vec((0usize..300, extreme(), extreme(), any::<u64>()), 1..6)
    ) {
        let recording = changed(|number, time, message| {
            for (place, monotonic_us, wall_ns, device_us) in &places {
                if number == *place {
                    *time = HostTime { monotonic_us: *monotonic_us, wall_ns: *wall_ns };
                    if let Some((known_us, _)) = message {
                        *known_us = *device_us;
                    }
                    return;
                }
            }
        });
        if let Some(mut replayer) = started(recording.clone(), Pace::RealTime) {
            for now_us in [0, 1, i64::MAX / 2, i64::MAX, i64::MIN] {
                replayer.play(now_us).unwrap();
                replayer.due_us(now_us);
            }
            replay(recording);
        }
    }
}
