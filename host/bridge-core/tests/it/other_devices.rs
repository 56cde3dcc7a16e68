//! Devices with another model or shape than announced, and devices that replace the announced
//! device.

use crate::board::{Board, assert_has, at};
use crate::recorder::{Harness, SETTINGS, commands};

#[test]
fn codes_of_another_model_are_published_without_a_reconstruction() {
    let mut harness = Harness::new(
        SETTINGS,
        Board {
            model_id: [9; 8],
            ..Board::new()
        },
    );
    harness.connect();
    harness.code(1, false);
    assert_eq!(harness.recorder.encoded.len(), 1);
    assert!(harness.recorder.windows.is_empty());
    assert!(!harness.recorder.announced[0].decodable);
    let report = harness.core.diagnostics(at(harness.now_us));
    let text = format!("{:?}", report.status[0]);
    assert_has(&text, ["0909090909090909", "--model"]);
}

#[test]
fn a_code_of_another_model_than_the_introduced_one_is_not_published() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.board.model_id = [9; 8];
    harness.code(1, false);
    assert!(harness.recorder.encoded.is_empty());
    assert_eq!(harness.core.summary().unused, 1);
}

#[test]
fn a_device_of_another_shape_is_refused_until_the_first_one_returns() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.core.disconnected();
    let other = Board {
        hop_steps: 16,
        session_id: 77,
        ..Board::new()
    };
    let right = std::mem::replace(&mut harness.board, other);
    harness.connect();
    harness.code(1, false);
    assert_eq!(harness.recorder.encoded.len(), 1);
    assert_eq!(harness.core.summary().unused, 1);
    let report = harness.report("device");
    assert_has(&report, ["Error", "rate and window"]);
    harness.core.disconnected();
    harness.board = right;
    harness.connect();
    harness.code(1, false);
    // The code of the refused device has a filler in its place.
    assert_eq!(harness.fillers(), [false, true, false]);
    let report = harness.report("device");
    assert_has(&report, ["streaming"]);
}

#[test]
fn a_device_with_impossible_capabilities_is_refused() {
    for board in [
        Board {
            hop_steps: 0,
            ..Board::new()
        },
        Board {
            hop_steps: 17,
            step_rate_hz: 136,
            ..Board::new()
        },
        Board {
            hop_steps: 9,
            ..Board::new()
        },
    ] {
        let mut harness = Harness::connected(SETTINGS, board);
        harness.code(1, false);
        assert!(harness.recorder.announced.is_empty() && harness.recorder.encoded.is_empty());
    }
}

#[test]
fn another_board_that_streams_already_is_stopped_first() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.code(1, false);
    harness.core.disconnected();
    harness.board = Board {
        chip_uid: [8; 12],
        session_id: 5,
        streaming: true,
        next_window: 1000,
        ..Board::new()
    };
    harness.connect();
    assert_eq!(commands(&harness), ["identify", "stop", "start"]);
    harness.code(2, false);
    let summary = harness.core.summary();
    assert_eq!((summary.received, summary.lost), (2, 0));
    assert_eq!(
        harness.recorder.announced.len(),
        2,
        "another chip is announced again"
    );
}

#[test]
fn a_device_that_differs_from_the_announced_one_is_refused() {
    for (other, what) in [
        (
            Board {
                model_id: [9; 8],
                ..Board::new()
            },
            "model",
        ),
        (
            Board {
                labels: Board::new().labels.replace("Cz", "XX"),
                ..Board::new()
            },
            "montage",
        ),
    ] {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        harness.core.disconnected();
        harness.board = Board {
            session_id: 5,
            ..other
        };
        harness.connect();
        harness.code(1, false);
        let report = harness.report("device");
        assert_has(&report, [&format!("in its {what};"), "restart"]);
        assert!(harness.recorder.encoded.is_empty());
    }
}
