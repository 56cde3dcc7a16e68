//! Impedance of the electrodes: what the host asks for, and how it handles the measurements.

use link::{AckResult, Impedance, Streams, ToHost};
use neuro_ros::DiagnosticLevel;

use crate::board::Board;
use crate::recorder::{Harness, SETTINGS, commands, state};

/// Creates a harness whose user asks for impedances, and states 2.2 kOhm in series with each
/// electrode.
fn measuring(board: Board) -> Harness {
    let mut harness = Harness::new(SETTINGS, board);
    harness.core.measure_impedance(2_200);
    harness.connect();
    harness
}

/// Returns how often the device was asked to measure impedance.
fn asked(harness: &Harness) -> usize {
    let commands = commands(harness);
    commands.iter().filter(|name| **name == "set impedance").count()
}

#[test]
fn the_device_measures_once_it_streams_and_again_after_a_restart() {
    let mut harness = measuring(Board::new());
    harness.exchange();
    assert_eq!(commands(&harness)[1..], ["stop", "start", "set impedance"]);
    harness.codes(20, 1);
    assert_eq!((asked(&harness), harness.core.impedance_refusal()), (1, None));
    harness.board.received.clear();
    harness.reboot(1_000_000);
    harness.codes(20, 1);
    assert_eq!(asked(&harness), 1);
}

#[test]
fn a_measurement_alone_streams_nothing_but_events() {
    let mut harness = Harness::new(SETTINGS, Board::new());
    harness.core.measure_impedance_alone(0);
    harness.connect();
    harness.exchange();
    assert_eq!(harness.board.streams, Streams::EVENTS);
    assert_eq!(asked(&harness), 1);
    // The device still streams, although it sends neither codes nor blocks. If the bridge started
    // it again, the measurement would begin again.
    for _ in 0..20 {
        harness.now_us += 1_000_000;
        let stats = harness.board.stats(Streams::EVENTS);
        harness.receive(&stats);
        harness.exchange();
    }
    let names = commands(&harness);
    assert_eq!(names.iter().filter(|name| **name == "start").count(), 1);
}

#[test]
fn a_device_that_does_not_measure_is_asked_once_and_streams_all_the_same() {
    for (ack_result, remedy) in [
        (AckResult::Busy, "corticode-bridge impedance"),
        (AckResult::NotSupported, "NUCLEO-H743ZI2"),
        (AckResult::UnknownCommand, "update the firmware"),
    ] {
        let mut harness = measuring(Board::answering(ack_result));
        harness.codes(40, 1);
        assert_eq!((asked(&harness), harness.recorder.encoded.len()), (1, 40));
        let refusal = harness.core.impedance_refusal().expect("a refusal");
        assert!(refusal.contains(remedy), "{refusal}");
    }
}

#[test]
fn a_measurement_is_published_once_and_warns_of_bad_contacts() {
    let mut harness = measuring(Board::new());
    harness.codes(3, 1);
    assert!(harness.status("impedance").is_none());
    let labels: Vec<String> = (harness.board.labels.split(' ')).map(str::to_owned).collect();
    let mut ohms = vec![7_300; labels.len()];
    ohms[4] = 30_000;
    ohms[5] = Impedance::OPEN;
    let bytes: Vec<u8> = ohms.iter().flat_map(|ohms: &u32| ohms.to_le_bytes()).collect();
    let impedance = Impedance { ohms: &bytes };
    harness.send(harness.now_us.unsigned_abs(), &ToHost::Impedance(impedance));
    let status = harness.status("impedance").expect("a status");
    let words = format!("open: {}; 20 kOhm or more: {}", labels[5], labels[4]);
    assert_eq!(state(&status), (DiagnosticLevel::Warn, words.as_str()));
    assert_eq!(status.values[0].value, "5.1 kOhm");
    assert_eq!(harness.recorder.impedances, 1);
    assert!(harness.status("impedance").is_none());
}
