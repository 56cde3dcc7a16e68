//! Exclusion of bad electrodes: what the host asks for, and how it handles the device's reports.

use bridge_core::{Exclusions, Settings};
use link::{AckResult, Exclusion, ExclusionPolicy, Streams, ToDevice, ToHost};
use neuro_ros::DiagnosticLevel;

use crate::board::Board;
use crate::recorder::{Harness, SETTINGS, commands, state};

const EVENTS: Settings = Settings { streams: Streams::from_bits(0b1_0001), ..SETTINGS };

/// Label of electrode 3, and the policy that always excludes it.
fn third(board: &Board) -> (String, ExclusionPolicy) {
    let label = board.labels.split(' ').nth(3).unwrap().to_owned();
    let policy = ExclusionPolicy { always: 1 << 3, ..ExclusionPolicy::AUTOMATIC };
    (label, policy)
}

/// Creates a harness whose user wants electrode 3 to be always excluded.
fn excluding(board: Board) -> (Harness, ExclusionPolicy) {
    let (label, policy) = third(&board);
    let mut harness = Harness::new(EVENTS, board);
    harness.core.set_exclusions(Exclusions {
        always: vec![label.to_lowercase(), "Xy".to_owned()],
        ..Exclusions::default()
    });
    harness.connect();
    (harness, policy)
}

fn report(excluded: u64, policy: ExclusionPolicy) -> ToHost<'static> {
    ToHost::Exclusion(Exclusion { first_step: 64, excluded, policy })
}

#[test]
fn the_device_is_told_before_it_streams_and_after_each_restart() {
    let (mut harness, policy) = excluding(Board::new());
    let with_exclusion = ["stop", "set exclusion", "start"];
    assert_eq!(commands(&harness)[1..], with_exclusion);
    let told = |(_, command): &(u32, ToDevice)| *command == ToDevice::SetExclusion(policy);
    assert!(harness.board.received.iter().any(told));
    harness.board.received.clear();
    harness.reboot(1_000_000);
    assert_eq!(commands(&harness), with_exclusion);
}

#[test]
fn a_policy_that_another_host_has_set_is_replaced() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    let (_, policy) = third(&harness.board);
    harness.send(0, &report(1 << 3, policy));
    harness.exchange();
    let default = ToDevice::SetExclusion(ExclusionPolicy::AUTOMATIC);
    assert_eq!(harness.board.received.last().unwrap().1, default);
    // The device's next report has the new policy, so the command is not repeated.
    let commands = harness.board.received.len();
    harness.send(0, &report(0, ExclusionPolicy::AUTOMATIC));
    harness.exchange();
    assert_eq!(harness.board.received.len(), commands);
}

#[test]
fn a_device_that_cannot_exclude_streams_all_the_same() {
    for ack_result in [AckResult::NotSupported, AckResult::UnknownCommand] {
        let (mut harness, _) = excluding(Board::answering(ack_result));
        harness.codes(20, 1);
        let told = commands(&harness);
        let told = told.iter().filter(|name| **name == "set exclusion");
        assert_eq!((told.count(), harness.recorder.encoded.len()), (1, 20));
    }
}

#[test]
fn a_change_of_the_excluded_electrodes_is_an_event_and_a_warning() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    let (label, _) = third(&harness.board);
    harness.codes(3, 1);
    for excluded in [0, 1 << 3, 1 << 3, 0] {
        let device_us = harness.now_us.unsigned_abs();
        harness.send(device_us, &report(excluded, ExclusionPolicy::AUTOMATIC));
        let status = harness.status("exclusion").unwrap();
        let expected = if excluded == 0 {
            (DiagnosticLevel::Ok, "no electrode is excluded".to_owned())
        } else {
            (DiagnosticLevel::Warn, format!("filled from the others: {label}"))
        };
        assert_eq!(state(&status), (expected.0, expected.1.as_str()));
    }
    let events = harness.recorder.events.iter();
    let events: Vec<(i32, &str)> =
        events.map(|event| (event.event, event.description.as_str())).collect();
    let excluded = format!("electrodes excluded: {label}");
    let expected = [(0x7f04, &*excluded), (0x7f04 | 0x8000, "no electrode excluded")];
    assert_eq!(events, expected);
}

/// A replayed recording reports the policy with which it was recorded, and refuses another one.
#[test]
fn a_refused_policy_is_not_sent_again_with_each_report() {
    let mut harness = Harness::streaming(EVENTS, Board::answering(AckResult::NotSupported));
    let (_, policy) = third(&harness.board);
    for _ in 0..5 {
        harness.send(0, &report(1 << 3, policy));
        harness.exchange();
        harness.codes(16, 1);
    }
    let sent = commands(&harness);
    let sent = sent.iter().filter(|name| **name == "set exclusion");
    assert_eq!(sent.count(), 1);
}

#[test]
fn a_restart_ends_the_exclusion() {
    let mut harness = Harness::streaming(EVENTS, Board::new());
    harness.codes(3, 1);
    harness.send(0, &report(1 << 3, ExclusionPolicy::AUTOMATIC));
    harness.reboot(1_000_000);
    harness.codes(20, 1);
    let codes = harness.recorder.events.iter().map(|event| event.event);
    let codes: Vec<i32> = codes.filter(|code| code & 0x7fff == 0x7f04).collect();
    assert_eq!(codes, [0x7f04, 0xff04]);
    assert!(harness.status("exclusion").is_none());
}
