//! A recording of codes and packed blocks is replayed to a bridge that asks only for packed blocks.

use std::io::Cursor;

use bridge_core::Core;
use capture::{Pace, Replayer};
use link::Streams;
use neuro_ros::DiagnosticLevel;

use crate::board::{Board, at, model};
use crate::packed_device::PACKED;
use crate::packed_recording::PackedRecording;
use crate::recorder;

/// Returns a recording with `hops` codes and as many packed blocks, and with `Stats` once a second.
fn recording(hops: u32) -> Vec<u8> {
    let mut recording = PackedRecording::new(Board::new(), Streams::CODES | Streams::PACKED);
    for index in 0..hops {
        recording.hop();
        if index % 16 == 15 {
            recording.stats();
        }
    }
    recording.finish()
}

#[test]
fn codes_that_the_host_did_not_ask_for_are_not_lost() {
    let mut replayer = Replayer::new(Cursor::new(recording(64)), Pace::RealTime).unwrap();
    let mut core = Core::new(PACKED, Some(model()));
    let mut effects = recorder::Recorder::default();
    core.connected(at(0), &mut effects);
    for now in (5_000..10_000_000).step_by(5_000) {
        let sent = std::mem::take(&mut effects.sent);
        replayer.receive(&sent).unwrap();
        replayer.play(now).unwrap();
        core.receive(&replayer.take(), at(now), &mut effects);
    }
    assert_eq!(effects.blocks.len(), 64);
    assert!(effects.blocks.iter().all(|block| block.block.is_some()));
    assert!(effects.encoded.is_empty());
    let summary = core.summary();
    assert_eq!((summary.made, summary.lost, summary.fillers), (0, 0, 0));
    let mut statuses = core.diagnostics(at(10_000_000)).status.into_iter();
    let loss = statuses.find(|status| status.name.ends_with("loss"));
    assert_eq!(loss.unwrap().level, DiagnosticLevel::Ok);
}
