//! The subcommand `convert` of recordings with packed blocks.

use std::path::{Path, PathBuf};

use link::Streams;

use crate::board::{Board, assert_has};
use crate::convert::{Table, convert};
use crate::packed_recording::{HOP_US, PackedRecording};

fn write(folder: &Path, bytes: Vec<u8>) -> PathBuf {
    let path = folder.join("session.wire");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Converts a recording, and returns the rows of its signals.
fn signals(recording: PackedRecording) -> Table {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), recording.finish());
    let (status, log) = convert(&path, "csv");
    assert_eq!(status, Some(0), "{log}");
    Table::read(&folder.path().join("session.reconstructed.csv"))
}

#[test]
fn a_recording_of_another_model_has_an_error_that_names_the_model() {
    let mut board = Board::new();
    board.model_id = [9; 8];
    let mut recording = PackedRecording::new(board, Streams::PACKED);
    for _ in 0..20 {
        recording.hop();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), recording.finish());
    let (status, log) = convert(&path, "csv");
    assert_eq!(status, Some(2), "{log}");
    assert_has(&log, ["--model and the folder of model 0909090909090909"]);
    assert!(!log.contains("record again"), "{log}");
}

#[test]
fn every_block_has_rows_also_where_the_recording_was_not_ended() {
    let recording = || {
        let mut recording = PackedRecording::new(Board::new(), Streams::PACKED);
        for _ in 0..20 {
            recording.hop();
        }
        recording
    };
    assert_eq!(signals(recording()).rows.len(), 160);
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), recording().cut_off());
    let (status, log) = convert(&path, "csv");
    assert_eq!(status, Some(0), "{log}");
    let table = Table::read(&folder.path().join("session.reconstructed.csv"));
    assert_eq!(table.rows.len(), 160);
}

#[test]
fn events_beside_a_restart_stand_at_their_rows() {
    let streams = Streams::PACKED | Streams::EVENTS;
    let mut recording = PackedRecording::new(Board::new(), streams);
    for _ in 0..20 {
        recording.hop();
    }
    // The last row is 10 ms old, the delay of the filters, and rows are 7.8 ms apart.
    recording.event(20_000);
    recording.restart(8 * HOP_US);
    for _ in 0..20 {
        recording.hop();
        recording.event(0);
    }
    let table = signals(recording);
    let fillers = (0..table.rows.len()).filter(|row| table.is_filler(*row));
    assert!(fillers.eq(160..224));
    // The last event comes after the last row.
    let after = (0..19).map(|block| 224 + 8 * block + 9);
    assert_eq!(
        table.events(),
        [158].into_iter().chain(after).collect::<Vec<_>>()
    );
}
