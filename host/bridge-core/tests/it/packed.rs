//! Packed blocks: the commands for them, their decoding, their loss and the status about them.

use std::sync::Arc;

use artifact::reconstruction::HEALING_BLOCKS;
use bridge_core::{AuditedWindow, FillerPolicy, PackedReconstruction, Settings};
use link::{Flags, Streams};
use neuro_ros::{DiagnosticLevel, NeuroFrame};

use crate::board::{Board, assert_has, at, model};
use crate::packed_block::{block, coarser_block};
use crate::packed_device::{PACKED, Packed, decode, flags, frames};
use crate::recorder::{Harness, commands, value};

#[test]
fn with_low_latency_each_block_yields_its_signals_at_once() {
    let mut device = Packed::new(PACKED);
    device.send_all(70, false);
    let frames = frames(&device.harness.recorder, PACKED);
    let (expected, _) = decode((0..70).map(Some));
    let signals: Vec<&Vec<f32>> = frames.iter().map(|frame| &frame.eeg.data).collect();
    assert_eq!(signals, expected.iter().collect::<Vec<_>>());
    assert!(flags(&frames).iter().all(|flags| *flags == 0));
    let has_signal = |frame: &NeuroFrame| frame.eeg.data.iter().any(|uv| uv.abs() > 5.0);
    assert!(frames.iter().any(has_signal));
    assert_eq!(frames[0].eeg.info.transducter, "packed code");
    for (index, frame) in (0..).zip(&frames) {
        assert_eq!(frame.neuroheader.seq, index + 1);
        // Stamps are one hop apart. A stamp is the time at which the frame's first step was at the
        // electrodes: 7 steps before its last step, which left the filters 10 ms late.
        let stamp_us = frame.header.stamp.nanoseconds() / 1000;
        let last_step_us = 1_000_000 + 62_500 * (i64::from(index) + 1);
        let expected_us = at(last_step_us - 7 * 7_812 - 4 - 10_000).wall_ns / 1000;
        assert!((stamp_us - expected_us).abs() < 10, "{stamp_us} {expected_us}");
        assert_eq!(frame.tri.data[1], i32::try_from(index).unwrap());
    }
}

#[test]
fn otherwise_a_block_yields_the_frame_before_it_with_its_correction() {
    let smooth = Settings { low_latency: false, ..PACKED };
    let mut device = Packed::new(smooth);
    device.send_all(70, false);
    let frames = frames(&device.harness.recorder, smooth);
    let (plain, smoothed) = decode((0..70).map(Some));
    assert_eq!(frames.len(), 69, "the newest block waits");
    for (index, frame) in frames.iter().enumerate() {
        // A block without prediction does not correct the block before it.
        let expected = smoothed[index + 1].as_ref().unwrap_or(&plain[index]);
        assert_eq!(&frame.eeg.data, expected, "block {index}");
        assert_eq!(smoothed[index + 1].is_none(), index == 63);
        assert_eq!(frame.tri.data[1], i32::try_from(index).unwrap());
    }
    assert_ne!(frames[5].eeg.data, plain[5]);
}

#[test]
fn a_lost_block_even_the_first_is_predicted_and_flagged_until_the_state_has_healed() {
    let lost = |index: u32| [0, 10, 11, 12, 40].contains(&index);
    let mut device = Packed::new(PACKED);
    for index in 0..80 {
        device.send(lost(index));
    }
    let frames = frames(&device.harness.recorder, PACKED);
    let (expected, _) = decode((0..80).map(|index| (!lost(index)).then_some(index)));
    let signals: Vec<&Vec<f32>> = frames.iter().map(|frame| &frame.eeg.data).collect();
    assert_eq!(signals, expected.iter().collect::<Vec<_>>());
    let healing = u32::try_from(HEALING_BLOCKS).unwrap();
    for (index, flags) in (0..).zip(flags(&frames)) {
        let heals = |last: u32| (last + 1..=last + healing).contains(&index);
        let due = match index {
            index if lost(index) => Flags::FILLER,
            _ if heals(0) || heals(12) || heals(40) => Flags::HEALING,
            _ => Flags::empty(),
        };
        assert_eq!(flags, due.bits(), "block {index}");
    }
    let summary = device.harness.core.summary();
    let packed = summary.packed;
    assert_eq!((packed.made, packed.received, packed.lost, packed.fillers), (80, 75, 5, 5));
    assert_eq!(summary.frames_lost, 5);
    // The filler policy decides the values in frames of lost blocks, not in later frames.
    for (filler, due) in [(FillerPolicy::Zeros, 80), (FillerPolicy::Off, 75)] {
        let settings = Settings { filler, ..PACKED };
        let mut other = Packed::new(settings);
        for index in 0..80 {
            other.send(lost(index));
        }
        let others = crate::packed_device::frames(&other.harness.recorder, settings);
        assert_eq!(others.len(), due);
        assert_eq!(others.last().unwrap().eeg.data, frames[79].eeg.data);
        if filler == FillerPolicy::Zeros {
            assert!(others[11].eeg.data.iter().all(|uv| *uv == 0.0));
        }
    }
}

#[test]
fn codes_beside_blocks_are_published_and_not_decoded() {
    let both = Settings { streams: Streams::CODES | Streams::PACKED, ..PACKED };
    let mut device = Packed::new(both);
    for _ in 0..4 {
        device.send(false);
        device.harness.now_us -= 62_500;
        device.harness.code(1, false);
    }
    let recorder = &device.harness.recorder;
    assert_eq!(recorder.encoded.len(), 4);
    assert_eq!((recorder.windows.len(), recorder.blocks.len()), (0, 4));
    // Each block has its own device time, even the first one, which comes before any code.
    for (block, device_us) in recorder.blocks.iter().zip((1_062_500..).step_by(62_500)) {
        assert_eq!(block.words.device_time_us, device_us);
    }
}

#[test]
fn the_report_states_rate_bits_and_what_does_not_fit_the_model() {
    let mut device = Packed::new(PACKED);
    assert!(device.harness.status("packed code").is_none());
    device.send(false);
    device.harness.status("packed code").unwrap();
    let mut bits = 0;
    for _ in 0..16 {
        bits += 8 * block(device.next, 0, 4).len();
        device.send(false);
    }
    let status = device.harness.status("packed code").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
    assert_eq!(status.message, format!("rate 4, {bits} bits per second"));
    assert_eq!(value(&status, "received"), "17");
    assert_eq!(value(&status, "without prediction"), "1");
    assert_eq!(value(&status, "too long, coarser"), "0");
    let of_device = device.harness.status("device").unwrap();
    assert_eq!(of_device.message, "streaming");

    device.flags = Flags::MISFIT;
    device.send_all(10, false);
    let status = device.harness.status("packed code").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert!(status.message.starts_with("10 of 10 blocks do not fit"));
    assert_eq!(value(&status, "misfits"), "10");

    device.flags = Flags::BLANK;
    device.send(false);
    let status = device.harness.status("packed code").unwrap();
    assert!(status.message.starts_with("1 of 1 blocks were too long"));

    // The stream has rate 4, but the device quantised this block at rate 7.
    device.flags = Flags::empty();
    let coarser = coarser_block(device.next, 0, [4, 7]);
    device.send_bytes(&coarser, false);
    let status = device.harness.status("packed code").unwrap();
    assert_has(&status.message, ["1 of 1 blocks too long and coarser"]);
    assert_eq!(value(&status, "too long, coarser"), "1");

    // Rate 16 does not exist in this release, so the block cannot be decoded.
    device.flags = Flags::empty();
    device.rate = 16;
    device.send_bytes(&[1, 2, 3], false);
    let frames = frames(&device.harness.recorder, PACKED);
    assert_eq!(flags(&frames).last(), Some(&Flags::FILLER.bits()));
}

#[test]
fn a_device_of_another_model_is_counted_and_not_decoded() {
    let mut device = Packed::of(Harness::connected(PACKED, Board::of_another_model()));
    device.send_all(3, false);
    assert!(device.harness.recorder.blocks.is_empty());
    assert_eq!(device.harness.core.summary().packed.received, 3);
    let message = device.harness.status("device").unwrap().message;
    assert_has(&message, ["this program decodes"]);
    assert!(!message.contains("codes are"), "{message}");
}

/// Returns an audited window with index `window` and `signals`, rounded to int8. `signals` are in
/// microvolts: all electrodes of the first step, then all electrodes of the next, and so on.
pub(crate) fn window(device: &Packed, window: u32, signals: &[f32]) -> AuditedWindow {
    let model = model();
    let electrodes = model.electrodes().len();
    let (_, level_uv) = model.electrodes_uv(&[]);
    // Find the cell of each electrode: setting it changes the electrode's signal.
    let cells = model.window_cells() / 16;
    let mut planes = vec![0_i8; model.window_cells()];
    for cell in 0..cells {
        let mut probe = vec![0_i8; cells];
        probe[cell] = 1;
        let (probed, _) = model.electrodes_uv(&probe);
        let Some(electrode) = probed.iter().position(|uv| *uv != 0.0) else {
            continue;
        };
        for step in 0..16 {
            let level = f64::from(signals[step * electrodes + electrode]) / level_uv;
            #[expect(clippy::cast_possible_truncation, reason = "saturates")]
            let level = level.round() as i8;
            planes[step * cells + cell] = level;
        }
    }
    AuditedWindow {
        device: Arc::clone(&device.harness.recorder.announced[0].device),
        window,
        planes,
        levels: Vec::new(),
        resolution: 1,
    }
}

#[test]
fn an_audit_measures_the_error_of_the_blocks_in_its_window() {
    let mut device = Packed::new(PACKED);
    for index in 0..8 {
        device.send(index == 5);
    }
    let recorder = &device.harness.recorder;
    let announced = &recorder.announced[0].device;
    let mut decoder = PackedReconstruction::new(announced, &model(), PACKED).unwrap();
    let blocks = recorder.blocks.iter();
    let frames: Vec<Vec<f32>> =
        blocks.map(|block| decoder.next_frame(block).unwrap().eeg.data.clone()).collect();
    // The measured signals differ from the blocks' signals by 6 uV, alternately up and down.
    let measured = |first: usize| -> Vec<f32> {
        let signals = frames[first..first + 2].concat();
        let signs = [6.0, -6.0].into_iter().cycle();
        signals.iter().zip(signs).map(|(uv, off)| uv + off).collect()
    };
    let error = window(&device, 2, &measured(2)).compare_packed(&model(), &decoder);
    let error = error.expect("both blocks came");
    assert!((error.rms_uv - 6.0).abs() < 0.1, "{error:?}");
    // A device without the network sends no code that could be compared.
    let without_code = window(&device, 2, &measured(2));
    assert_eq!(without_code.compare(&model()), None);
    let of_variance = (error.rms_uv / model().sd_uv()).powi(2);
    assert!((error.of_variance / of_variance - 1.0).abs() < 1e-6);
    // For equal signals, the rounding of the window to int8 does not count as an error.
    let exact = window(&device, 2, &frames[2..4].concat());
    let exact = exact.compare_packed(&model(), &decoder).unwrap();
    assert!(exact.rms_uv < 0.5, "{exact:?}");
    // Nothing is compared if a block is lost (5), not yet received (8), or an input is at the rail.
    for first in [4, 7] {
        let window = window(&device, first, &measured(2));
        assert_eq!(window.compare_packed(&model(), &decoder), None);
    }
    let mut clipped = window(&device, 2, &measured(2));
    clipped.planes[300] = 127;
    assert_eq!(clipped.compare_packed(&model(), &decoder), None);
}

#[test]
fn the_rate_is_set_before_the_start_and_while_blocks_arrive() {
    let asked = Settings { packed_rate: Some(7), ..PACKED };
    let mut device = Packed::new(asked);
    assert_eq!(commands(&device.harness), ["identify", "stop", "set rate", "start"]);
    assert_eq!(device.harness.board.rate, 7);
    device.send(false);
    device.harness.core.set_packed_rate(2);
    let now = at(device.harness.now_us);
    device.harness.core.tick(now, &mut device.harness.recorder);
    device.harness.exchange();
    assert_eq!(device.harness.board.rate, 2);
    assert_eq!(commands(&device.harness).last(), Some(&"set rate"));
    // A device that is not asked for packed blocks gets no command that sets their rate.
    let codes = Settings { streams: Streams::CODES, ..asked };
    assert!(!commands(&Packed::new(codes).harness).contains(&"set rate"));
}

#[test]
fn a_device_that_cannot_set_the_rate_streams_all_the_same() {
    let asked = Settings { packed_rate: Some(7), ..PACKED };
    // The board refuses packed blocks too, and is then asked for codes.
    let without_packed = Streams::ALL.without(Streams::PACKED);
    let harness = Harness::connected(asked, Board::supporting(without_packed));
    assert_eq!(commands(&harness), ["identify", "stop", "set rate", "start", "start"]);
}

#[test]
fn a_rate_that_changes_before_the_device_has_answered_is_sent_too() {
    let mut device = Packed::new(PACKED);
    let harness = &mut device.harness;
    harness.core.set_packed_rate(5);
    harness.tick();
    let answers = harness.answers();
    assert_eq!(harness.board.rate, 5);
    harness.core.set_packed_rate(7);
    harness.receive(&answers);
    harness.exchange();
    assert_eq!(harness.board.rate, 7);
}
