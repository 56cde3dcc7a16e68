//! A recording of codes and packed blocks, replayed to a bridge that asks for packed blocks alone.

use std::io::Cursor;

use bridge::{Core, FileHeader, Pace, Recorder, Replayer};
use link::{
    Ack, AckResult, Encoder, Flags, MAX_FRAME, PackedCode, Start, Stats, Streams, ToDevice, ToHost,
};
use neuro_ros::DiagnosticLevel;

use crate::board::{Board, at, model};
use crate::packed_device::{PACKED, block};
use crate::recorder;

/// Returns a recording of `hops` codes and packed blocks, with the device's `Stats` once a second.
fn recording(hops: u32) -> Vec<u8> {
    let both = Streams::CODES | Streams::PACKED;
    let mut board = Board::new();
    let mut recorder = Recorder::new(FileHeader {
        created_ns: 0,
        streams: both,
        mains_hz: 0,
    });
    recorder.opened(at(0));
    recorder.received(&board.hello(), at(1000));
    let mut buffer = [0; MAX_FRAME];
    let start = ToDevice::Start(Start {
        streams: both,
        mains_hz: 0,
    });
    let start = Encoder::default().encode(0, &start, &mut buffer);
    recorder.sent(start.unwrap(), at(2000));
    let ack = ToHost::Ack(Ack {
        of: 0,
        result: AckResult::Done,
    });
    recorder.received(&board.frame(0, &ack), at(3000));
    for index in 0..hops {
        let us = 1_000_000 + i64::from(index) * 62_500;
        let bytes = block(index, 0, 4);
        let packed = ToHost::PackedCode(PackedCode {
            block: index,
            rate: 4,
            flags: Flags::empty(),
            clipped: 0,
            saturated: 0,
            bytes: &bytes,
        });
        recorder.received(&board.frame(us.unsigned_abs(), &packed), at(us));
        recorder.received(&board.code(us.unsigned_abs(), 1), at(us));
        if index % 16 == 15 {
            let stats = ToHost::Stats(Stats {
                streams: both,
                next_window: index + 1,
                codes_made: index + 1,
                ..Stats::default()
            });
            recorder.received(&board.frame(us.unsigned_abs(), &stats), at(us));
        }
    }
    recorder.take()
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
