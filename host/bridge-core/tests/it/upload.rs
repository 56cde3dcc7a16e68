//! Upload of a packed model to the device before it streams.

use bridge_core::{Settings, Upload};
use link::{ModelBegin, Streams};

use crate::board::{BUILT_IN, Board, model};
use crate::recorder::{Harness, SETTINGS, commands, value};

const PACKED: Settings = Settings { streams: Streams::PACKED, ..SETTINGS };

/// Content of the uploaded model, three chunks long. The bridge does not interpret it.
fn content() -> Vec<u8> {
    (0..3000_u32).map(|byte| (byte * 31 % 251).to_le_bytes()[0]).collect()
}

/// Creates a harness, not connected yet, whose core has a model to upload to the board.
fn uploading(board: Board) -> Harness {
    uploading_with(PACKED, board)
}

fn uploading_with(settings: Settings, board: Board) -> Harness {
    let mut harness = Harness::new(settings, board);
    let upload = Upload::new(model().id(), content().into());
    harness.core.set_upload(upload);
    harness
}

/// Returns the bytes of the model that the board has received.
fn uploaded(harness: &Harness) -> &[u8] {
    &harness.board.slot.as_ref().unwrap().1
}

const UPLOAD: [&str; 5] = ["model begin", "model chunk", "model chunk", "model chunk", "model end"];

#[test]
fn a_device_with_another_model_gets_it_before_it_streams_and_after_each_restart() {
    let mut harness = uploading(Board::with_slot());
    harness.connect();
    let all = [&["identify", "stop"], &UPLOAD[..], &["start"]].concat();
    assert_eq!(commands(&harness), all);
    assert_eq!(uploaded(&harness), content());
    assert_eq!(harness.core.objection(), None);
    let id = artifact::ModelId(model().id()).to_string();
    assert_eq!(value(&harness.status("device").unwrap(), "model"), id);
    assert_eq!(harness.core.summary().resets, 0, "a new model is no restart");

    harness.board.received.clear();
    harness.reboot(1_000_000);
    assert_eq!(commands(&harness), all[1..]);
    assert_eq!(uploaded(&harness), content());
    assert_eq!(harness.core.objection(), None);
}

#[test]
fn an_upload_begins_again_when_the_device_knows_no_announcement() {
    let mut harness = uploading(Board::with_slot());
    harness.open();
    while uploaded(&harness).is_empty() {
        harness.exchange_once();
    }
    // The device restarts, and its introduction is lost.
    harness.board.slot = Some((ModelBegin::default(), Vec::new()));
    harness.exchange();
    assert_eq!(uploaded(&harness), content());
    assert_eq!(commands(&harness).last(), Some(&"start"));
    assert_eq!(harness.core.objection(), None);
}

#[test]
fn an_upload_goes_on_where_a_lost_connection_has_ended_it() {
    let mut harness = uploading(Board::with_slot());
    harness.open();
    while uploaded(&harness).is_empty() {
        assert!(!harness.recorder.sent.is_empty());
        harness.exchange_once();
    }
    let report = harness.status("device").unwrap().message;
    assert!(report.contains("34 %"), "{report}");
    harness.core.disconnected();
    harness.recorder.sent.clear();
    harness.board.received.clear();
    harness.connect();
    let rest = ["identify", "model begin", "model chunk", "model chunk", "model end", "start"];
    assert_eq!(commands(&harness), rest);
    assert_eq!(uploaded(&harness), content());
}

#[test]
fn lost_answers_are_asked_for_again() {
    let mut harness = uploading(Board::with_slot());
    harness.open();
    let mut round = 0;
    while !harness.board.streaming && round < 100 {
        let answers = harness.answers();
        // Every third answer is lost as a whole.
        if round % 3 != 2 {
            harness.receive(&answers);
        }
        if harness.recorder.sent.is_empty() {
            harness.now_us += 500_000;
            harness.tick();
        }
        round += 1;
    }
    assert!(harness.board.streaming, "{:?}", commands(&harness));
    assert_eq!(uploaded(&harness), content());
    assert_eq!(harness.board.model_id, model().id());
}

#[test]
fn a_device_without_a_slot_is_used_as_it_is_and_the_reason_is_reported() {
    let mut board = Board::new();
    board.model_id = BUILT_IN;
    let mut harness = uploading(board);
    harness.connect();
    let all = ["identify", "stop", "model begin", "identify", "start"];
    assert_eq!(commands(&harness), all);
    let objection = harness.core.objection().unwrap();
    assert!(objection.contains("6275696c7420696e"), "{objection}");
}

/// Exchanges bytes until the board streams. The board's memory corrupts a bit of each model that it
/// receives, so the board refuses the model three times.
fn refuse(harness: &mut Harness) {
    harness.board.received.clear();
    while !harness.board.streaming {
        assert!(!harness.recorder.sent.is_empty());
        let slot = harness.board.slot.as_mut().unwrap();
        if let Some(last) = slot.1.last_mut() {
            *last ^= 1;
        }
        harness.exchange_once();
    }
    let commands = commands(harness);
    let ends = commands.iter().filter(|name| **name == "model end");
    assert_eq!(ends.count(), 3);
}

#[test]
fn a_model_that_the_device_finds_unsound_is_sent_three_times_and_again_after_a_restart() {
    let mut harness = uploading(Board::with_slot());
    harness.open();
    refuse(&mut harness);
    assert!(harness.core.objection().is_some());
    harness.reboot(1_000_000);
    assert_eq!(uploaded(&harness), content());
    assert_eq!(harness.core.objection(), None);
}

#[test]
fn a_device_that_refuses_the_model_after_a_restart_streams_its_own() {
    let settings = Settings { streams: Streams::CODES, ..PACKED };
    let mut harness = uploading_with(settings, Board::with_slot());
    harness.connect();
    assert_eq!(harness.core.objection(), None);
    harness.codes(3, 1);

    harness.board.reboot();
    harness.now_us += 1_000_000;
    let hello = harness.board.hello();
    harness.receive(&hello);
    refuse(&mut harness);
    harness.exchange();
    let objection = harness.core.objection().unwrap();
    assert!(objection.contains("6275696c7420696e"), "{objection}");
    let announced = harness.recorder.announced.iter();
    let ids = announced.map(|announced| announced.device.model_id);
    assert_eq!(ids.collect::<Vec<_>>(), [model().id(), BUILT_IN]);
    harness.codes(3, 1);
    let fillers = harness.fillers();
    let [first, .., a, b, c] = fillers[..] else {
        panic!("{} codes", fillers.len());
    };
    assert!(![first, a, b, c].contains(&true), "{fillers:?}");

    // A device with other codes counts as another device.
    harness.board.code_scale[0] = 0.25;
    harness.reboot(1_000_000);
    let report = harness.status("device").unwrap().message;
    assert!(report.contains("another device"), "{report}");
}

#[test]
fn a_device_is_asked_for_a_slot_at_each_start_and_does_not_stream_without_one() {
    for (board, with_linear, has_slot) in [
        (Board::with_slot(), false, true),
        (Board::with_slot(), true, false),
        (Board::new(), false, false),
    ] {
        let mut harness = Harness::new(PACKED, board);
        harness.core.require_slot(with_linear);
        harness.connect();
        assert_eq!(harness.core.lacks_slot(), !has_slot);
        let all = ["identify", "stop", "model begin", "start"];
        let expected = if has_slot { &all[..] } else { &all[..3] };
        assert_eq!(commands(&harness), expected);
        harness.board.received.clear();
        harness.reboot(1_000_000);
        assert_eq!(commands(&harness), expected[1..]);
    }
}

#[test]
fn no_model_is_sent_to_a_device_that_has_it_or_has_other_electrodes() {
    let has_it = Board { model_id: model().id(), ..Board::with_slot() };
    let other = Board { labels: Board::new().labels.replace("Cz", "Xy"), ..Board::with_slot() };
    for board in [has_it, other] {
        let mut harness = uploading(board);
        harness.connect();
        assert_eq!(commands(&harness), ["identify", "stop", "start"]);
    }
}
