//! Reconstruction of electrode signals from codes.

use std::path::Path;
use std::sync::Arc;

use artifact::Artifact;
use artifact::reconstruction::{HopLayout, Overlap, Source, Window, WindowDecoder};
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
        words: TriWords { window: index, ..TriWords::default() },
    }
}

#[test]
fn frames_keep_the_contract_and_are_numbered() {
    let mut reconstruction = Reconstruction::new(&device(Board::new()), model(), SETTINGS);
    let first = reconstruction.next_frame(&window(0, Some(z(0)))).unwrap().clone();
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
fn a_frame_carries_the_flags_of_both_its_windows_and_that_of_a_missing_one() {
    // A frame decoded from one window alone has the flag `HEALING`: its error is larger.
    let alone = i32::from(Flags::HEALING.bits());
    // Columns: whether the code arrives; index of the window; flags of the window; flags of the
    // frame.
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
            assert_eq!(frame.unwrap().tri.data[0], expected, "window {index}, {decodes}");
        }
    }
}

/// Tests only that the bits are equal. Whether the values are right is tested in
/// `artifact::reconstruction`: averages of windows, the newest steps with low latency, limits at
/// full scale, and no values of another stream.
#[test]
fn frames_hold_the_bits_of_the_crate_that_every_program_decodes_with() {
    let artifact =
        Artifact::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../signal/model/artifact"));
    let decoder = WindowDecoder::new(&artifact.unwrap()).unwrap();
    for (hop_steps, low_latency) in [(8, false), (8, true), (16, false)] {
        let device = device(Board { hop_steps, ..Board::new() });
        let settings = Settings { low_latency, ..SETTINGS };
        let mut reconstruction = Reconstruction::new(&device, model(), settings);
        let mut overlap = Overlap::new(HopLayout {
            steps: usize::from(hop_steps),
            electrodes: device.labels.len(),
            low_latency,
            full_scale_uv: 187_500.0,
        });
        let mut hop = vec![0.0; usize::from(hop_steps) * device.labels.len()];
        // The stream restarts after window 3. The values of the second window after the restart
        // exceed full scale.
        let scaled =
            |index: u16, by: f32| -> Vec<f32> { z(index).iter().map(|value| value * by).collect() };
        for (index, values) in [
            (0, Some(z(0))),
            (1, Some(z(1))),
            (2, None),
            (3, Some(z(3))),
            (0, Some(scaled(0, -1.0))),
            (1, Some(scaled(1, 1e6))),
        ] {
            let decoded = Window {
                index,
                flags: 0,
                values: values.as_ref().map(|values| decoder.decode(values)),
            };
            // The values of a frame without a code depend on the filler policy, which another test
            // covers.
            let source = overlap.next_hop(decoded, &mut hop).source;
            let frame = reconstruction.next_frame(&window(index, values)).unwrap();
            if source != Source::Missing {
                assert_eq!(frame.eeg.data, hop, "{hop_steps}, {low_latency}, window {index}");
            }
        }
    }
}
