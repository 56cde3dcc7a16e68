//! Publication of ADC samples on `/neurodata` and of filtered steps on `/neurodata_corticode`.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::float_cmp,
    reason = "counts of 24 bits; the expected values are computed as the bridge does"
)]

use bridge_core::{FillerPolicy, Settings, StampPoint};
use link::{Filtered, Flags, Raw, Streams, ToHost};
use neuro_ros::{DiagnosticLevel, NeuroFrame};

use crate::board::{Board, WALL_START_NS};
use crate::recorder::{Harness, SETTINGS, fillers, state, value};

pub(crate) const SAMPLES: Settings = Settings { streams: Streams::from_bits(0b00111), ..SETTINGS };

/// Scale of the board's ADC, microvolts per count, rounded to f32 as in `Capabilities`.
const COUNT_UV: f64 = 22.351_742_f32 as f64 / 1000.0;

/// Returns the counts of `samples` consecutive ADC samples from sample `first` on, packed as on the
/// wire. Every count identifies its sample and channel.
pub(crate) fn counts(first: u64, samples: u64, channels: u8) -> Vec<u8> {
    let count = |sample: u64, channel: u8| (sample % 50_000 * 100) as i32 - i32::from(channel);
    let samples = (first..first + samples)
        .flat_map(|sample| (0..channels).map(move |channel| count(sample, channel)));
    samples
        .flat_map(|count| {
            let [low, middle, high, _] = count.to_le_bytes();
            [low, middle, high]
        })
        .collect()
}

/// Returns a harness whose clock is fitted to one code, which was read at the time it was made.
pub(crate) fn harness(settings: Settings) -> Harness {
    let mut harness = Harness::streaming(settings, Board::new());
    harness.code(0, false);
    harness
}

/// Returns the device time of ADC sample `sample`, microseconds. Sample 0 is at 2 s.
pub(crate) fn time(sample: u64) -> u64 {
    2_000_000 + sample * 1_000_000 / 512
}

/// Delivers eight ADC samples, from sample `first` on, at the device time of the last one.
pub(crate) fn send_samples(harness: &mut Harness, first: u64, flags: Flags) {
    let us = time(first + 7);
    harness.now_us = us.cast_signed();
    send_samples_at(harness, us, first, flags);
}

/// Delivers eight ADC samples, from sample `first` on, in a message made at `device_us`.
pub(crate) fn send_samples_at(harness: &mut Harness, device_us: u64, first: u64, flags: Flags) {
    let counts = counts(first, 8, 64);
    let raw = Raw { first_sample: first, channels: 64, flags, counts: &counts };
    harness.send(device_us, &ToHost::Raw(raw));
}

/// Returns one sample of a frame: values of its 61 electrodes, and of its 3 spare channels.
fn row(frame: &NeuroFrame, sample: usize) -> (&[f32], &[f32]) {
    let (eeg, exg) = (&frame.eeg.data, &frame.exg.data);
    (&eeg[sample * 61..][..61], &exg[sample * 3..][..3])
}

fn microvolt(sample: u64, channel: u64) -> f32 {
    (((sample % 50_000 * 100) as f64 - channel as f64) * COUNT_UV) as f32
}

#[test]
fn raw_samples_become_frames_of_one_hop_with_spare_channels_in_exg() {
    let mut harness = harness(SAMPLES);
    for message in 0..8 {
        send_samples(&mut harness, message * 8, Flags::empty());
    }
    assert_eq!(harness.recorder.raw.len(), 2);
    let frame = &harness.recorder.raw[1];
    assert_eq!((frame.sr, frame.eeg.info.nsamples), (512, 32));
    let info = &frame.eeg.info;
    assert_eq!((info.nchannels, info.stride, &*info.unit), (61, 244, "uV"));
    assert_eq!(info.labels, crate::board::model().electrodes());
    assert_eq!(&*info.prefiltering, "none");
    assert!((info.minmax[1] - 8_388_608.0 * COUNT_UV).abs() < 1e-6);
    let exg = &frame.exg.info;
    assert_eq!((exg.nchannels, exg.stride, exg.nsamples), (3, 12, 32));
    assert_eq!(
        (&exg.labels[..], &*exg.unit),
        (&["exg1", "exg2", "exg3"].map(str::to_owned)[..], "uV")
    );
    for sample in 0..32 {
        let (eeg, exg) = row(frame, sample);
        let index = 32 + sample as u64;
        assert_eq!((eeg[0], eeg[60]), (microvolt(index, 0), microvolt(index, 60)));
        assert_eq!((exg[0], exg[2]), (microvolt(index, 61), microvolt(index, 63)));
        let words = &frame.tri.data[sample * 8..][..8];
        let us = i64::from(words[3]) | i64::from(words[4]) << 16 | i64::from(words[5]) << 32;
        assert!((us - time(index).cast_signed()).abs() <= 1, "sample {index}: {us}");
        assert_eq!((words[0], words[1], words[6], words[7]), (0, 1, 0, 0));
    }
}

#[test]
fn the_delay_of_the_filters_is_removed_from_stamps_of_steps_only() {
    for (stamp, raw_us, filtered_us) in [
        // The second frame begins at sample 32 or step 8, 62.5 ms after the first sample. Stamps of
        // steps are 10 ms earlier, because the filter delay is subtracted.
        (StampPoint::First, 62_500, 52_500),
        // A frame's last sample is 31 samples (60,546 us) after its first; its last step is 7 steps
        // (54,687 us) after its first.
        (StampPoint::Last, 62_500 + 60_546, 52_500 + 54_687),
    ] {
        let mut harness = harness(Settings { stamp, ..SAMPLES });
        for message in 0..8 {
            send_samples(&mut harness, message * 8, Flags::empty());
            if message % 2 == 1 {
                steps(&mut harness, (message - 1) * 2, 61, 5);
            }
        }
        for (frame, expected) in
            [(&harness.recorder.raw[1], raw_us), (&harness.recorder.filtered[1], filtered_us)]
        {
            let since = frame.header.stamp.nanoseconds() - WALL_START_NS - 2_000_000_000;
            assert!((since / 1000 - expected).abs() <= 2, "{stamp:?}: {since} ns");
        }
    }
}

/// Delivers four filtered steps from step `first` on. In each step, the value of every electrode is
/// the step's index.
fn steps(harness: &mut Harness, first: u64, electrodes: u8, fraction_bits: u8) {
    let values = (first..first + 4).flat_map(|step| {
        let value = i32::try_from(step << fraction_bits).unwrap();
        (0..electrodes).flat_map(move |_| value.to_le_bytes())
    });
    let values: Vec<u8> = values.collect();
    let filtered = Filtered {
        first_step: first,
        electrodes,
        fraction_bits,
        flags: Flags::SETTLING,
        values: &values,
    };
    let last_us = time((first + 3) * 4);
    harness.send(last_us, &ToHost::Filtered(filtered));
}

#[test]
fn filtered_steps_become_frames_of_one_hop_in_microvolts() {
    let mut harness = harness(SAMPLES);
    for message in 0..4 {
        steps(&mut harness, message * 4, 61, 5);
    }
    assert_eq!(harness.recorder.filtered.len(), 2);
    let frame = &harness.recorder.filtered[1];
    let info = &frame.eeg.info;
    assert_eq!((frame.sr, info.nsamples, info.nchannels), (128, 8, 61));
    assert_eq!((&*info.prefiltering, frame.exg.info.nchannels), ("none", 0));
    for step in 0..8 {
        let expected = ((8 + step) as f64 * COUNT_UV) as f32;
        assert_eq!(frame.eeg.data[step * 61 + 60], expected);
        assert_eq!(frame.tri.data[step * 8], i32::from(Flags::SETTLING.bits()));
    }
    assert!(harness.recorder.raw.is_empty());
}

#[test]
fn steps_are_clamped_to_the_announced_range() {
    let mut harness = harness(SAMPLES);
    let values = [i32::MAX.to_le_bytes(), i32::MIN.to_le_bytes()].concat();
    let values = values.repeat(61 * 4);
    for first_step in [0, 8] {
        let filtered = Filtered {
            first_step,
            electrodes: 61,
            fraction_bits: 0,
            flags: Flags::empty(),
            values: &values,
        };
        harness.send(time(28), &ToHost::Filtered(filtered));
    }
    let frame = &harness.recorder.filtered[0];
    for value in &frame.eeg.data {
        assert!(f64::from(value.abs()) <= frame.eeg.info.minmax[1] + 0.01);
    }
}

#[test]
fn lost_samples_are_filled_flagged_and_counted() {
    for (filler, held) in [(FillerPolicy::Last, microvolt(39, 0)), (FillerPolicy::Zeros, 0.0)] {
        let mut harness = harness(Settings { filler, ..SAMPLES });
        for first in (0..40).chain(56..96).step_by(8) {
            send_samples(&mut harness, first, Flags::empty());
        }
        assert_eq!(harness.recorder.raw.len(), 3, "96 samples");
        let frame = &harness.recorder.raw[1];
        for sample in 0..32 {
            let index = 32 + sample as u64;
            let lost = (40..56).contains(&index);
            let flags = frame.tri.data[sample * 8];
            assert_eq!(flags & 0x8000 != 0, lost, "sample {index}");
            let expected = if lost { held } else { microvolt(index, 0) };
            assert_eq!(row(frame, sample).0[0], expected, "sample {index}");
            assert_eq!(frame.tri.data[sample * 8 + 6], if index < 40 { 0 } else { 16 });
        }
        let status = harness.status("loss").unwrap();
        let missing = "16 raw samples missing since the last report";
        assert_eq!(state(&status), (DiagnosticLevel::Warn, missing));
        let status = harness.status("loss").unwrap();
        assert_eq!(status.level, DiagnosticLevel::Ok);
        assert_eq!(value(&status, "raw samples lost"), "16");
    }
}

#[test]
fn without_fillers_a_frame_with_a_lost_sample_is_not_published() {
    let mut harness = harness(Settings { filler: FillerPolicy::Off, ..SAMPLES });
    for first in (0..40).chain(56..32_000).step_by(8).chain([96_000, 96_008, 96_016, 96_024]) {
        if !(512..9_600).contains(&first) {
            send_samples(&mut harness, first, Flags::empty());
        }
    }
    let frames = &harness.recorder.raw;
    assert!(!fillers(frames).contains(&true));
    let indices = frames.iter().map(|frame| frame.tri.data[1]);
    let expected = (0..1).chain(2..16).chain(300..1000).chain([3000]);
    assert!(indices.eq(expected));
}

#[test]
fn an_outage_too_long_to_fill_is_counted_and_frames_stay_aligned() {
    let mut harness = harness(SAMPLES);
    send_samples(&mut harness, 0, Flags::empty());
    // Samples are missing for 200 s. Only 120 s are filled.
    let first = 512 * 200 + 8;
    for message in 0..7 {
        send_samples(&mut harness, first + message * 8, Flags::empty());
    }
    let frames = harness.recorder.raw.clone();
    // The published frames are the first one, which fillers complete; about 1,920 frames of fillers
    // (120 s); and the one with the newest samples.
    let last = frames.last().unwrap();
    assert_eq!(row(last, 31).0[0], microvolt(first + 55, 0));
    assert!((1921..=1923).contains(&frames.len()), "{}", frames.len());
    let mut figure = |key| harness.figure("loss", key).parse::<u64>().unwrap();
    assert_eq!(figure("raw samples lost"), 512 * 200);
    let published = frames.len() as u64 * 32;
    assert_eq!(figure("raw samples not published") + published, first + 56);
}

#[test]
fn samples_before_the_first_code_are_stamped() {
    let mut harness = Harness::streaming(SAMPLES, Board::new());
    for first in [0, 8, 16, 24] {
        send_samples(&mut harness, first, Flags::empty());
    }
    let stamp = harness.recorder.raw[0].header.stamp.nanoseconds();
    let off = stamp - WALL_START_NS - 2_000_000_000;
    assert!(off.abs() < 2_000, "{off} ns");
}
