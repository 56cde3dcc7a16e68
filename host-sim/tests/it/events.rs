//! Events of a recording are played as pulses of the trigger input, each at the sample of its
//! event.

use std::{fs, io::Read as _, path::Path};

use link::{Event, EventKind, Streams, ToHost};

use crate::edf_file::EdfFile;
use crate::gdf_file::gdf_file;
use crate::program::{connect, frames, free_address, program, run, send, start, wait};

/// Plays a recording to a host that requests events. Returns each event, with its time since the
/// run's first sample in microseconds.
fn played(input: &Path, more: &[&str]) -> Vec<(Event, u64)> {
    let address = free_address();
    let input = format!("--input={}", input.display());
    let output = format!("--output=tcp:{address}");
    let arguments = [&["run", "-q", "--fast", &input, &output], more].concat();
    let child = program(&arguments).spawn().expect("the program starts");
    let mut port = connect(&address);
    send(&mut port, 0, start(Streams::CODES | Streams::EVENTS));
    let mut bytes = Vec::new();
    port.read_to_end(&mut bytes).expect("all frames");
    drop(port);
    let finished = wait(child);
    assert_eq!(finished.status, Some(0), "{finished:?}");

    frames(&bytes, |frame| match frame.message {
        ToHost::Event(event) => Some((event, frame.header.device_time_us)),
        _ => None,
    })
}

/// Returns the edges of pulses of 10 ms that start at `starts_ms`, milliseconds of the signal.
fn pulses(starts_ms: &[u64]) -> Vec<(Event, u64)> {
    let edges = starts_ms
        .iter()
        .flat_map(|start| [(EventKind::TriggerRise, *start), (EventKind::TriggerFall, start + 10)]);
    let rate = u64::from(model::ADC_RATE_HZ);
    let event = |(number, (kind, at_ms)): (u32, (EventKind, u64))| {
        let sample = (at_ms * rate).div_ceil(1000);
        let event = Event { kind, number, sample };
        (event, at_ms * 1000)
    };
    (0..).zip(edges).map(event).collect()
}

/// Checks the played events against the expected ones; a time may differ by a microsecond.
fn assert_played(played: &[(Event, u64)], expected: &[(Event, u64)]) {
    let events = |all: &[(Event, u64)]| all.iter().map(|(event, _)| *event).collect::<Vec<_>>();
    assert_eq!(events(played), events(expected));
    for ((event, at_us), (_, expected_us)) in played.iter().zip(expected) {
        assert!(at_us.abs_diff(*expected_us) <= 1, "{event:?} at {at_us} us");
    }
}

#[test]
fn annotations_of_edf_are_pulses_at_their_samples() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("annotated.edf");
    let mut file = EdfFile::with_all_electrodes(4);
    // The event "Right" is stored in the second record, but its time is in the first. "Late" is
    // after the end of the file.
    file.annotations = vec![
        b"+0\x14\x14\0+0.25\x14Left\x14\0",
        b"+1\x14\x14\0+0.125\x152\x14Right\x14\0",
        b"+2\x14\x14\0+2.5\x14Left\x14Cue\x14\0",
        b"+3\x14\x14\0+9\x14Late\x14\0",
    ];
    fs::write(&path, file.bytes()).expect("writable");
    assert_played(&played(&path, &[]), &pulses(&[125, 250, 2500]));

    // With --trigger-every, periodic edges replace the edges of the recording.
    let numbers: Vec<u64> =
        played(&path, &["--trigger-every=1"]).into_iter().map(|(_, us)| us).collect();
    assert_eq!(numbers.first(), Some(&1_000_000));

    let input = format!("--input={}", path.display());
    let finished = run(&["run", "-q", &input, "--output=file:/dev/null"]);
    assert!(
        finished.log.contains("1 events are outside the signal")
            && finished.log.contains("1 events are less than 2 ms after another one"),
        "{finished:?}"
    );
}

#[test]
fn events_of_gdf_are_pulses_except_ends_and_sparse_samples() {
    let events = [(50, 0x0301), (150, 0x8301), (180, 0x7fff), (200, 0x0302)];
    let file = gdf_file(100, 300, &events, |row| vec![row.into(); model::ELECTRODES]);
    assert_played(&played(file.path(), &[]), &pulses(&[500, 2000]));
}

#[test]
fn each_event_at_a_sample_of_the_adc_is_sent_with_that_sample_up_to_the_last_one() {
    let rate = model::ADC_RATE_HZ;
    let rows = [1, 3, 7, 500, 511, 2 * rate - 1];
    let events = rows.map(|row| (row.into(), 0x0301));
    let file = gdf_file(rate, 2 * rate, &events, |_| vec![1.0; model::ELECTRODES]);
    let events = played(file.path(), &[]).into_iter().map(|(event, _)| event);
    let rises = events.filter(|event| event.kind == EventKind::TriggerRise);
    let samples: Vec<u64> = rises.map(|event| event.sample).collect();
    assert_eq!(samples, rows.map(u64::from));
}
