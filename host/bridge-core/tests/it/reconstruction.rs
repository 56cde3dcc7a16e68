//! Reconstruction of electrode signals from codes.

use std::path::Path;
use std::sync::Arc;

use artifact::Artifact;
use artifact::reconstruction::{HopLayout, Overlap, Window, WindowDecoder};
use bridge_core::{Device, FillerPolicy, Reconstruction, Settings, TimedCode, TriWords};
use link::Flags;
use neuro_ros::{Shape, Stamp};

use crate::board::{Board, electrode, model};
use crate::recorder::{Harness, SETTINGS};

fn device(board: Board) -> Arc<Device> {
    let harness = Harness::streaming(SETTINGS, board);
    Arc::clone(&harness.recorder.announced[0].device)
}

/// Returns the values of a code for a window. Different windows get different values.
fn z(window: u16) -> Vec<f32> {
    let phases = (0..128_u16).map(|index| f32::from(window) * 0.7 + f32::from(index));
    phases.map(|phase| 3.0 * phase.sin()).collect()
}

fn window(index: u32, z: Option<Vec<f32>>) -> TimedCode {
    TimedCode {
        z,
        stamp: Stamp { secs: 1, nsecs: 0 },
        words: TriWords {
            window: index,
            ..TriWords::default()
        },
    }
}

/// Returns the frames that consecutive windows complete, from window 0 on. `windows[i]` states
/// whether the code of window `i` was received.
fn frames(settings: Settings, windows: &[bool]) -> Vec<Option<Vec<f32>>> {
    let mut reconstruction = Reconstruction::new(&device(Board::new()), model(), settings);
    let mut index = 0;
    windows
        .iter()
        .map(|received| {
            let frame =
                reconstruction.next_frame(&window(index.into(), received.then(|| z(index))));
            index += 1;
            frame.map(|frame| frame.eeg.data.clone())
        })
        .collect()
}

fn steps(window: u16, range: std::ops::Range<usize>) -> Vec<f32> {
    model().decode(&z(window))[range.start * 61..range.end * 61].to_vec()
}

#[test]
fn frames_keep_the_contract_and_are_numbered() {
    let mut reconstruction = Reconstruction::new(&device(Board::new()), model(), SETTINGS);
    let first = reconstruction
        .next_frame(&window(0, Some(z(0))))
        .unwrap()
        .clone();
    let shape = Shape::from_frame(&first).unwrap();
    assert_eq!((shape.sr, shape.nsamples), (128, 8));
    assert_eq!(shape.nchannels, [61, 0, 8]);
    let info = &first.eeg.info;
    assert_eq!((&*info.unit, &info.labels[0]), ("uV", &electrode(0)));
    assert!((info.minmax[1] - 187_500.0).abs() < 0.01);
    let second = reconstruction.next_frame(&window(1, Some(z(1)))).unwrap();
    assert_eq!((first.neuroheader.seq, second.neuroheader.seq), (1, 2));
    assert_eq!(second.header.seq, 2);
}

#[test]
fn two_windows_are_averaged_where_they_overlap() {
    let frames = frames(SETTINGS, &[true, true]);
    // No earlier window shares the first hop, so it is not averaged.
    assert_eq!(frames[0], Some(steps(0, 0..8)));
    let (old, new) = (steps(0, 8..16), steps(1, 0..8));
    let averaged = frames[1].as_ref().unwrap();
    for (index, value) in averaged.iter().enumerate() {
        let mean = f32::midpoint(old[index], new[index]);
        // The limit allows for rounding: neighbouring f32 numbers at 100 uV are 8e-6 apart.
        assert!((value - mean).abs() < 1e-4, "value {index}: {value}");
    }
}

#[test]
fn low_latency_publishes_the_newest_steps_of_each_window() {
    let settings = Settings {
        low_latency: true,
        ..SETTINGS
    };
    let frames = frames(settings, &[true, true]);
    assert_eq!(frames[1], Some(steps(1, 8..16)));
}

#[test]
fn one_lost_window_is_reconstructed_from_its_neighbours() {
    let frames = frames(SETTINGS, &[true, false, true, true]);
    // The hop of the lost window is also part of the previous window, which was received.
    assert_eq!(frames[1], Some(steps(0, 8..16)));
    assert_eq!(frames[2], Some(steps(2, 0..8)), "nothing to average with");
}

#[test]
fn steps_that_no_window_contains_are_filled_and_flagged() {
    let device = device(Board::new());
    for (filler, expected) in [
        (FillerPolicy::Last, Some(true)),
        (FillerPolicy::Zeros, Some(false)),
        (FillerPolicy::Off, None),
    ] {
        let settings = Settings { filler, ..SETTINGS };
        let mut reconstruction = Reconstruction::new(&device, model(), settings);
        reconstruction.next_frame(&window(0, Some(z(0))));
        let held = reconstruction.next_frame(&window(1, None)).unwrap().clone();
        assert_eq!(held.tri.data[0] & 0x8000, 0, "real data");
        let filled = reconstruction.next_frame(&window(2, None)).cloned();
        assert_eq!(filled.is_some(), expected.is_some(), "{filler:?}");
        let (Some(filled), Some(holds)) = (filled, expected) else {
            continue;
        };
        assert_eq!(filled.tri.data[0] & 0x8000, 0x8000);
        let last_step = &held.eeg.data[7 * 61..];
        let expected = if holds { last_step } else { &[0.0; 61] };
        for step in filled.eeg.data.chunks(61) {
            assert_eq!(step, expected, "{filler:?}");
        }
    }
}

#[test]
fn with_hop_16_frames_are_whole_windows() {
    let device = device(Board {
        hop_steps: 16,
        ..Board::new()
    });
    let mut reconstruction = Reconstruction::new(&device, model(), SETTINGS);
    reconstruction.next_frame(&window(0, Some(z(0))));
    let frame = reconstruction.next_frame(&window(1, Some(z(1)))).unwrap();
    assert_eq!((frame.sr, frame.eeg.info.nsamples), (128, 16));
    assert_eq!(frame.eeg.data, steps(1, 0..16));
}

#[test]
fn values_are_clamped_to_the_announced_range() {
    let mut reconstruction = Reconstruction::new(&device(Board::new()), model(), SETTINGS);
    let frame = reconstruction
        .next_frame(&window(0, Some(vec![1e6; 128])))
        .unwrap();
    assert!(frame.eeg.data.iter().all(|value| value.abs() <= 187_500.01));
}

#[test]
fn windows_of_two_streams_are_not_averaged() {
    let mut reconstruction = Reconstruction::new(&device(Board::new()), model(), SETTINGS);
    reconstruction.next_frame(&window(7, Some(z(0))));
    let frame = reconstruction.next_frame(&window(0, Some(z(1)))).unwrap();
    assert_eq!(frame.eeg.data, steps(1, 0..8));
    reconstruction.next_frame(&window(0, Some(z(0))));
    // The previous window belongs to another stream, so its steps cannot replace the lost ones.
    let frame = reconstruction.next_frame(&window(0, None)).unwrap();
    assert_eq!(frame.tri.data[0] & 0x8000, 0x8000);
}

#[test]
fn a_frame_carries_the_flags_of_both_its_windows_and_that_of_a_missing_one() {
    // A frame of one window alone has the flag of a larger error.
    let alone = i32::from(Flags::HEALING.bits());
    // Whether the code arrives, window, flags of the window, flags of the frame.
    let cases = [
        (true, 0, 2, 2 | alone),
        (true, 1, 4, 6),
        (true, 2, 0, 4),
        (true, 4, 1, 1 | alone),       // Window 2 is not adjacent.
        (false, 5, 0x8000, 1 | alone), // Only window 4 contributes.
        (false, 6, 0x8000, 0x8000),
        (true, 7, 0, alone),
        (true, 8, 0, 0),
    ];
    for decodes in [true, false] {
        let mut reconstruction = Reconstruction::new(&device(Board::new()), model(), SETTINGS);
        for (arrives, index, flags, expected) in cases {
            let mut window = window(index, arrives.then(|| z(0)));
            window.words.flags = flags;
            let frame = if decodes {
                reconstruction.next_frame(&window)
            } else {
                reconstruction.next_times(&window)
            };
            assert_eq!(
                frame.unwrap().tri.data[0],
                expected,
                "window {index}, {decodes}"
            );
        }
    }
}

#[test]
fn frames_hold_the_bits_of_the_crate_that_every_program_decodes_with() {
    let device = device(Board::new());
    let artifact =
        Artifact::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../signal/model/artifact"));
    let decoder = WindowDecoder::new(&artifact.unwrap()).unwrap();
    let electrodes = device.labels.len();
    let steps = usize::from(device.hop_steps);
    let mut overlap = Overlap::new(HopLayout {
        steps,
        electrodes,
        low_latency: false,
        full_scale_uv: 187_500.0,
    });
    let mut hop = vec![0.0; steps * electrodes];
    let received = [true, true, false, true];
    let frames = frames(SETTINGS, &received);
    for (index, (frame, received)) in (0..).zip(frames.iter().zip(received)) {
        let decoded = Window {
            index: index.into(),
            flags: 0,
            values: received.then(|| decoder.decode(&z(index))),
        };
        overlap.next_hop(decoded, &mut hop);
        assert_eq!(frame.as_ref(), Some(&hop), "window {index}");
    }
}
