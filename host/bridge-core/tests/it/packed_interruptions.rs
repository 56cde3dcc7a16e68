//! Packed blocks after long gaps, stops, restarts and reconnections.

use bridge_core::{PackedReconstruction, Settings};
use link::Flags;
use neuro_ros::NeuroFrame;

use crate::board::{assert_has, model};
use crate::packed_device::{PACKED, Packed, decode, flags, frames};
use crate::recorder::commands;

/// Settings of a bridge that corrects the signals of each block by the next block.
const SMOOTH: Settings = Settings { low_latency: false, ..PACKED };

/// Restarts the device. The restart takes `hops` hops.
fn restart(device: &mut Packed, hops: i64) {
    device.harness.reboot(hops * 62_500);
    device.next = 0;
}

/// Returns the signals of the first `blocks` blocks of a run. The next block has corrected each of
/// them except the last.
fn corrected(blocks: u32) -> Vec<Vec<f32>> {
    let (plain, smoothed) = decode((0..blocks).map(Some));
    let next = smoothed.into_iter().skip(1).chain([None]);
    let pairs = plain.into_iter().zip(next);
    pairs.map(|(plain, smoothed)| smoothed.unwrap_or(plain)).collect()
}

fn signals(frames: &[NeuroFrame]) -> Vec<&Vec<f32>> {
    frames.iter().map(|frame| &frame.eeg.data).collect()
}

fn stamps_increase(frames: &[NeuroFrame]) -> bool {
    let stamps = frames.iter().map(|frame| frame.header.stamp.nanoseconds());
    stamps.is_sorted_by(|before, after| before < after)
}

#[test]
fn after_a_stop_all_blocks_have_frames_and_the_next_recording_starts_anew() {
    let mut device = Packed::new(SMOOTH);
    device.send_all(5, false);
    assert_eq!(frames(&device.harness.recorder, SMOOTH).len(), 4);
    device.harness.set_streaming(false);
    let run = corrected(5);
    let stopped = frames(&device.harness.recorder, SMOOTH);
    assert_eq!(signals(&stopped), run.iter().collect::<Vec<_>>());
    device.harness.now_us += 3_000_000;
    device.harness.set_streaming(true);
    device.next = 0;
    // The first block of this recording, the one without prediction, is lost.
    for index in 0..5 {
        device.send(index == 0);
    }
    device.harness.set_streaming(false);
    let frames = frames(&device.harness.recorder, SMOOTH);
    assert_eq!(frames.len(), 10, "the pause is not filled");
    assert!(stamps_increase(&frames));
    let firsts = device.harness.recorder.blocks.iter();
    let firsts: Vec<bool> = firsts.map(|block| block.is_first).collect();
    assert_eq!(firsts, [&[true][..], &[false; 4], &[true], &[false; 4]].concat());
    // The prediction for the lost block does not build on blocks of the previous run.
    let (_, smoothed) = decode([None, Some(1)].into_iter());
    assert_eq!(Some(&frames[5].eeg.data), smoothed[1].as_ref());
    let filler = flags(&frames).iter().position(|flags| flags & 0x8000 != 0);
    assert_eq!(filler, Some(5));
}

#[test]
fn an_audit_after_a_stop_is_not_compared_with_blocks_of_the_recording_before() {
    let mut device = Packed::new(PACKED);
    device.send_all(5, false);
    device.harness.set_streaming(false);
    device.harness.now_us += 3_000_000;
    device.harness.set_streaming(true);
    device.next = 0;
    device.send(false);
    let recorder = &device.harness.recorder;
    let announced = &recorder.announced[0].device;
    let model = model();
    let mut decoder = PackedReconstruction::new(announced, &model, PACKED).unwrap();
    for block in &recorder.blocks {
        decoder.next_frame(block);
    }
    // The window covers blocks 2 and 3, which belong to the previous recording.
    let window = crate::packed::window(&device, 2, &[0.0; 16 * 61]);
    assert_eq!(window.compare_packed(&model, &decoder), None);
}

#[test]
fn a_restart_completes_the_frame_that_waits_and_fills_the_time_of_the_outage() {
    let mut device = Packed::new(SMOOTH);
    device.send_all(5, false);
    restart(&mut device, 4);
    device.send_all(5, false);
    device.harness.set_streaming(false);
    let summary = device.harness.core.summary().to_string();
    assert_has(&summary, ["fillers 4 bits"]);
    assert_has(&summary, ["; packed blocks: made 10 "]);
    let (_, packed) = summary.split_once("packed blocks").unwrap();
    assert!(packed.contains("missing between runs 4;"), "{summary}");
    let frames = frames(&device.harness.recorder, SMOOTH);
    assert_eq!(frames.len(), 14);
    assert!(stamps_increase(&frames));
    let run = corrected(5);
    assert_eq!(signals(&frames[..5]), run.iter().collect::<Vec<_>>());
    assert_eq!(signals(&frames[9..]), run.iter().collect::<Vec<_>>());
    // The first block of a run has no prediction, so the decoder's state is correct at once.
    let (filler, flags) = (Flags::FILLER.bits(), flags(&frames));
    assert!(flags[5..9].iter().all(|flags| flags & filler != 0));
    assert!(flags[..5].iter().chain(&flags[9..]).all(|flags| *flags == 0));
}

#[test]
fn a_gap_longer_than_the_fillers_is_counted_and_ends_at_the_next_block() {
    let mut device = Packed::new(PACKED);
    device.send(false);
    let lost = 70_000_u32;
    device.next += lost;
    device.harness.now_us += i64::from(lost) * 62_500;
    device.send(false);
    let blocks = &device.harness.recorder.blocks;
    assert_eq!(blocks.len(), 1 + 65_536 + 1);
    let (first, newest) = (&blocks[1], &blocks[blocks.len() - 1]);
    assert!(first.block.is_none() && newest.block.is_some());
    assert_eq!(first.words.flags, Flags::FILLER.bits());
    assert_eq!((first.words.window, newest.words.window), (lost - 65_536 + 1, lost + 1));
    assert_eq!(newest.words.lost, u64::from(lost));
    let packed = device.harness.core.summary().packed;
    assert_eq!((packed.received, packed.lost, packed.fillers), (2, u64::from(lost), 65_536));
}

#[test]
fn the_predictions_of_a_long_gap_come_to_a_standstill_until_the_next_block() {
    let mut device = Packed::new(PACKED);
    device.send_all(5, false);
    let gap = 4_000;
    device.send_all(gap, true);
    device.send_all(5, false);
    let frames = frames(&device.harness.recorder, PACKED);
    let lost = (0..5 + gap + 5).map(|index| (!(5..5 + gap).contains(&index)).then_some(index));
    let (expected, _) = decode(lost);
    assert_eq!(signals(&frames), expected.iter().collect::<Vec<_>>());
    // The predictions first decay. Rounding then keeps them at about half a microvolt.
    let gap = &frames[5..4_005];
    let largest = |frame: &NeuroFrame| {
        let values = frame.eeg.data.iter();
        values.fold(0.0_f32, |max, uv| max.max(uv.abs()))
    };
    assert!(largest(&gap[100]) < 0.2 * largest(&frames[4]));
    let stands_still = |frame: &NeuroFrame| frame.eeg.data == gap[100].eeg.data;
    assert!(gap[100..].iter().all(stands_still));
}

#[test]
fn the_rate_is_set_again_after_a_reconnection_and_after_a_restart() {
    let settings = Settings { packed_rate: Some(7), ..PACKED };
    let mut device = Packed::new(settings);
    let rates = |device: &Packed| {
        let commands = commands(&device.harness);
        commands.iter().filter(|name| **name == "set rate").count()
    };
    assert_eq!(rates(&device), 1);
    device.harness.core.disconnected();
    // Meanwhile another host, to which the cable was moved, has set another rate.
    device.harness.board.rate = 3;
    device.harness.connect();
    assert_eq!((rates(&device), device.harness.board.rate), (2, 7));
    device.harness.board.rate = 4;
    restart(&mut device, 0);
    assert_eq!((rates(&device), device.harness.board.rate), (3, 7));
}
