//! Devices come, go, reboot, and are not always the one that was expected.

use link::{Streams, ToHost};

use crate::board::{Board, at};
use crate::recorder::{Desk, SETTINGS, commands};

#[test]
fn a_device_is_asked_who_it_is_stopped_and_started() {
    let desk = Desk::streaming(SETTINGS, Board::new());
    assert_eq!(commands(&desk), ["identify", "stop", "start"]);
    assert_eq!(desk.recorder.announced.len(), 1);
    assert!(desk.recorder.announced[0].decodable);
}

#[test]
fn commands_without_an_answer_are_repeated() {
    let mut desk = Desk::new(SETTINGS, Board::new());
    desk.core.connected(at(0), &mut desk.recorder);
    for tick in 1..=20 {
        desk.core.tick(at(tick * 100_000), &mut desk.recorder);
    }
    let sent = std::mem::take(&mut desk.recorder.sent);
    desk.board.answer(&sent);
    // At 0 and every 0.5 s.
    assert_eq!(commands(&desk), ["identify"; 5]);
}

#[test]
fn a_lost_acknowledgement_of_start_costs_no_code() {
    let mut desk = Desk::new(SETTINGS, Board::new());
    desk.core.connected(at(desk.now_us), &mut desk.recorder);
    for _ in 0..3 {
        let commands = std::mem::take(&mut desk.recorder.sent);
        let answers = desk.board.answer(&commands);
        // Nothing that follows Start arrives.
        if desk.board.seen.len() < 3 {
            desk.receive(&answers);
        }
    }
    assert_eq!(commands(&desk), ["identify", "stop", "start"]);
    for _ in 0..20 {
        desk.code(1, false);
        // A board that streams acknowledges a repeated start and goes on.
        desk.converse();
    }
    assert_eq!(commands(&desk).len(), 4);
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost), (20, 0));
}

#[test]
fn a_reset_starts_cleanly_and_is_counted() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    for _ in 0..5 {
        desk.code(1, false);
    }
    desk.board.reboot();
    let hello = desk.board.hello();
    desk.receive(&hello);
    desk.converse();
    assert_eq!(commands(&desk).last(), Some(&"start"));
    for _ in 0..5 {
        desk.code(2, false);
    }
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost, summary.resets), (10, 0, 1));
    assert_eq!(
        desk.recorder.announced.len(),
        1,
        "the same device is announced once"
    );
}

#[test]
fn a_reset_whose_hello_was_lost_is_found_out() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    for _ in 0..30 {
        desk.code(1, false);
    }
    desk.board.reboot();
    desk.board.hello();
    for _ in 0..8 {
        let stats = desk.board.stats(Streams::empty());
        desk.receive(&stats);
    }
    desk.converse();
    desk.code(2, false);
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost, summary.resets), (31, 0, 1));
}

#[test]
fn an_outage_of_the_port_is_counted_and_filled() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    desk.core.disconnected();
    for _ in 0..16 {
        desk.code(1, true);
    }
    desk.connect();
    desk.code(2, false);
    assert_eq!(
        commands(&desk)[3..],
        ["identify", "start"],
        "a stream of ours is not stopped"
    );
    let summary = desk.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.fillers),
        (2, 16, 16)
    );
    assert_eq!(summary.connections, 2);
}

#[test]
fn a_thousand_outages_leave_the_ledger_closed() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    let (mut received, mut lost) = (0, 0);
    for outage in 0..1000 {
        let missing = outage % 7;
        desk.core.disconnected();
        // Half a frame is in the buffer when the cable goes.
        let half = desk.board.frame(0, &ToHost::Stats(link::Stats::default()));
        desk.receive(&half[..half.len() / 2]);
        for _ in 0..missing {
            desk.code(1, true);
        }
        desk.connect();
        desk.code(2, false);
        received += 1;
        lost += missing;
    }
    let summary = desk.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.fillers),
        (received, lost, lost)
    );
    assert_eq!((summary.connections, summary.resets), (1001, 0));
}

#[test]
fn a_stream_that_began_anew_during_an_outage_is_taken_up() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    for _ in 0..10 {
        desk.code(1, false);
    }
    desk.core.disconnected();
    desk.board.streaming = false;
    desk.connect();
    for _ in 0..3 {
        desk.code(2, false);
    }
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost), (13, 0));
}

#[test]
fn another_model_still_gives_codes_but_no_reconstruction() {
    let mut desk = Desk::new(
        SETTINGS,
        Board {
            model_id: [9; 8],
            ..Board::new()
        },
    );
    desk.connect();
    desk.code(1, false);
    assert_eq!(desk.recorder.encoded.len(), 1);
    assert!(desk.recorder.windows.is_empty());
    assert!(!desk.recorder.announced[0].decodable);
    let report = desk.core.diagnostics(at(desk.now_us));
    let text = format!("{:?}", report.status[0]);
    assert!(
        text.contains("0909090909090909") && text.contains("--model"),
        "{text}"
    );
}

#[test]
fn a_code_of_another_model_than_the_device_named_is_not_published() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.board.model_id = [9; 8];
    desk.code(1, false);
    assert!(desk.recorder.encoded.is_empty());
    assert_eq!(desk.core.summary().unused, 1);
}

#[test]
fn a_device_of_another_shape_is_refused_until_the_right_one_is_back() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    desk.core.disconnected();
    let other = Board {
        hop_steps: 16,
        session_id: 77,
        ..Board::new()
    };
    let right = std::mem::replace(&mut desk.board, other);
    desk.connect();
    desk.code(1, false);
    assert_eq!(desk.recorder.encoded.len(), 1);
    assert_eq!(desk.core.summary().unused, 1);
    let report = format!("{:?}", desk.core.diagnostics(at(desk.now_us)).status[0]);
    assert!(
        report.contains("Error") && report.contains("rate and window"),
        "{report}"
    );
    desk.core.disconnected();
    desk.board = right;
    desk.connect();
    desk.code(1, false);
    assert_eq!(desk.recorder.encoded.last().unwrap().neuroheader.seq, 2);
    let report = format!("{:?}", desk.core.diagnostics(at(desk.now_us)).status[0]);
    assert!(report.contains("streaming"), "{report}");
}

#[test]
fn a_device_that_introduces_itself_wrongly_is_refused() {
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
        let mut desk = Desk::new(SETTINGS, board);
        desk.connect();
        desk.code(1, false);
        assert!(desk.recorder.announced.is_empty() && desk.recorder.encoded.is_empty());
    }
}

#[test]
fn codes_that_come_before_the_device_is_known_are_counted_not_published() {
    let mut desk = Desk::new(SETTINGS, Board::new());
    desk.core.connected(at(desk.now_us), &mut desk.recorder);
    desk.code(1, false);
    assert!(desk.recorder.encoded.is_empty());
    assert_eq!(desk.core.summary().unused, 1);
}

#[test]
fn a_device_that_stops_by_itself_is_started_again() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    desk.board.streaming = false;
    let stats = desk.board.stats(Streams::empty());
    desk.receive(&stats);
    desk.converse();
    assert_eq!(commands(&desk)[3..], ["start"]);
    desk.code(2, false);
    assert_eq!(desk.core.summary().lost, 0);
}

#[test]
fn stop_and_start_are_obeyed() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    desk.core.want(false);
    desk.core.tick(at(desk.now_us), &mut desk.recorder);
    desk.converse();
    assert!(desk.core.is_stopped());
    desk.core.want(true);
    desk.core.tick(at(desk.now_us), &mut desk.recorder);
    desk.converse();
    desk.code(2, false);
    assert_eq!(commands(&desk)[3..], ["stop", "start"]);
    assert_eq!(
        (desk.recorder.encoded.len(), desk.core.summary().lost),
        (2, 0)
    );
}

#[test]
fn a_start_without_an_acknowledgement_is_taken_back_when_the_bridge_leaves() {
    let mut desk = Desk::new(SETTINGS, Board::new());
    desk.core.connected(at(desk.now_us), &mut desk.recorder);
    while desk.board.seen.len() < 3 {
        let sent = std::mem::take(&mut desk.recorder.sent);
        let answers = desk.board.answer(&sent);
        if desk.board.seen.len() < 3 {
            desk.receive(&answers);
        }
    }
    desk.code(1, false);
    desk.core.want(false);
    assert!(!desk.core.is_stopped());
    desk.code(1, true);
    desk.core.tick(at(desk.now_us), &mut desk.recorder);
    desk.converse();
    assert_eq!(commands(&desk), ["identify", "stop", "start", "stop"]);
    assert!(desk.core.is_stopped());
    let summary = desk.core.summary();
    assert_eq!(
        (summary.made, summary.lost),
        (2, 1),
        "the last report closes the ledger"
    );
}

#[test]
fn a_report_from_before_the_start_closes_nothing() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    for _ in 0..20 {
        desk.code(1, false);
    }
    desk.core.want(false);
    desk.core.tick(at(desk.now_us), &mut desk.recorder);
    desk.converse();
    // Plugged in again it is stopped again, and its report still tells of the old stream.
    desk.core.disconnected();
    desk.connect();
    assert_eq!(commands(&desk)[3..], ["stop", "identify", "stop"]);
    desk.core.want(true);
    desk.core.tick(at(desk.now_us), &mut desk.recorder);
    let late = desk.board.stats(Streams::empty());
    desk.receive(&late);
    desk.converse();
    desk.code(2, false);
    let summary = desk.core.summary();
    assert_eq!(
        (summary.received, summary.lost, summary.fillers),
        (21, 0, 0)
    );
}

#[test]
fn another_board_that_streams_already_is_stopped_first() {
    let mut desk = Desk::streaming(SETTINGS, Board::new());
    desk.code(1, false);
    desk.core.disconnected();
    desk.board = Board {
        chip_uid: [8; 12],
        session_id: 5,
        streaming: true,
        next_window: 1000,
        ..Board::new()
    };
    desk.connect();
    assert_eq!(commands(&desk), ["identify", "stop", "start"]);
    desk.code(2, false);
    let summary = desk.core.summary();
    assert_eq!((summary.received, summary.lost), (2, 0));
    assert_eq!(desk.recorder.announced.len(), 2, "another chip");
}

#[test]
fn what_was_announced_holds_for_the_session() {
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
            "electrodes",
        ),
    ] {
        let mut desk = Desk::streaming(SETTINGS, Board::new());
        desk.core.disconnected();
        desk.board = Board {
            session_id: 5,
            ..other
        };
        desk.connect();
        desk.code(1, false);
        let report = format!("{:?}", desk.core.diagnostics(at(desk.now_us)).status[0]);
        assert!(
            report.contains(&format!("its {what} are not those")) && report.contains("restart"),
            "{report}"
        );
        assert!(desk.recorder.encoded.is_empty());
    }
}
