//! Restarts of the device: on every topic, fillers replace the time without data.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "times of minutes; numbers of samples are whole"
)]

use bridge_core::{AnnouncedStream, FillerPolicy, Settings, StampPoint};
use link::{Event, EventKind, Filtered, Flags, Streams, ToHost};
use neuro_ros::DiagnosticLevel;

use crate::board::{Board, assert_has};
use crate::recorder::{Harness, SETTINGS, fillers, stamps, value};
use crate::samples::{SAMPLES, send_samples_at};

/// Time from one code to the next, microseconds.
const HOP_US: i64 = 62_500;

/// A board that streams codes, ADC samples and filtered steps, and the state of its present run.
struct Recording {
    harness: Harness,
    /// Host time at which the device's present run began, microseconds.
    run_us: i64,
    /// Number of hops in the present run so far.
    hops: u64,
}

impl Recording {
    fn new(settings: Settings) -> Recording {
        let harness = Harness::streaming(settings, Board::new());
        let run_us = harness.now_us;
        Recording { harness, run_us, hops: 0 }
    }

    /// Delivers all messages of one hop, each at the time at which the device made it.
    fn hop(&mut self) {
        self.messages(4);
        self.hops += 1;
        let us = self.at(self.hops * HOP_US as u64);
        let code = self.harness.board.code(us, 3);
        self.harness.receive(&code);
    }

    /// Delivers the first `count` of the four messages with the hop's samples, and the filtered
    /// steps that are complete by then.
    fn messages(&mut self, count: u64) {
        for message in 0..count {
            let first = self.hops * 32 + message * 8;
            let us = self.at((first + 7) * 1_000_000 / 512);
            send_samples_at(&mut self.harness, us, first, Flags::empty());
            if message % 2 == 1 {
                let first_step = self.hops * 8 + (message - 1) * 2;
                let values = [0_u8; 4 * 61 * 4];
                let filtered = Filtered {
                    first_step,
                    electrodes: 61,
                    fraction_bits: 0,
                    flags: Flags::empty(),
                    values: &values,
                };
                let us = self.at((first_step + 3) * 1_000_000 / 128);
                self.harness.send(us, &ToHost::Filtered(filtered));
            }
        }
    }

    /// Sets the host's time to `device_us` after the start of the run, and returns `device_us`.
    fn at(&mut self, device_us: u64) -> u64 {
        self.harness.now_us = self.run_us + device_us.cast_signed();
        device_us
    }

    /// Restarts the device. Its new run begins `outage_us` microseconds after its last code.
    fn restart(&mut self, outage_us: i64) {
        self.harness.reboot(outage_us);
        self.run_us = self.harness.now_us;
        self.hops = 0;
    }

    /// Returns the length of the data on each topic, seconds: codes, ADC samples, filtered steps.
    fn seconds(&self) -> [f64; 3] {
        let recorder = &self.harness.recorder;
        // Each of the three topics has 16 frames per second.
        [&recorder.encoded, &recorder.raw, &recorder.filtered]
            .map(|frames| frames.len() as f64 / 16.0)
    }
}

#[test]
fn the_time_of_a_restart_is_filled_flagged_and_counted_on_every_topic() {
    let mut recording = Recording::new(SAMPLES);
    let start_us = recording.harness.now_us;
    (0..16).for_each(|_| recording.hop());
    recording.restart(2_050_000);
    (0..16).for_each(|_| recording.hop());
    let passed = (recording.harness.now_us - start_us) as f64 / 1e6;
    for (topic, seconds) in ["codes", "raw", "filtered"].iter().zip(recording.seconds()) {
        // The last frame of samples may be unfinished, because the new run began within a frame.
        assert!((passed - seconds).abs() < 0.0625, "{topic}: {seconds} s of {passed} s");
    }
    let summary = recording.harness.core.summary();
    assert_eq!((summary.received, summary.lost, summary.resets), (32, 0, 1));
    // The outage of 2.05 s and the new run's first hop last 33.8 hops, rounded to 34. The device
    // made the code of the 34th hop, so 33 codes are missing.
    assert_eq!((summary.between_runs, summary.fillers), (33, 33));
    let fillers = recording.harness.fillers();
    assert_eq!(fillers.iter().filter(|filler| **filler).count(), 33);
    let text = summary.to_string();
    assert_has(&text, ["lost 0", "missing between runs 33"]);
    let loss = recording.harness.status("loss").unwrap();
    assert_eq!(loss.level, DiagnosticLevel::Warn);
    // 2.05 s at 512 Hz, rounded.
    assert_eq!(value(&loss, "raw samples missing between runs"), "1050");
}

#[test]
fn after_a_restart_too_long_to_fill_the_indices_of_codes_show_the_gap() {
    let mut recording = Recording::new(SETTINGS);
    (0..16).for_each(|_| recording.hop());
    let missing = 80_000;
    recording.restart(missing * HOP_US);
    recording.hop();
    let encoded = &recording.harness.recorder.encoded;
    let windows = encoded.iter().map(|frame| {
        let words = &frame.tri.data;
        i64::from(words[1]) | i64::from(words[2]) << 16
    });
    let windows: Vec<i64> = windows.collect();
    // 16 codes; 65,536 fillers, which have the last indices of the previous run; a code of the new
    // run.
    assert_eq!(windows.len(), 16 + 65_536 + 1);
    assert_eq!(windows[15..17], [15, 16 + missing - 65_536]);
    assert_eq!(windows[16 + 65_535..], [15 + missing, 0]);
}

#[test]
fn samples_after_a_restart_stand_at_the_time_at_which_they_were_taken() {
    for outage_us in [130_000, 1_234_567, 59_999_999] {
        let mut recording = Recording::new(SAMPLES);
        (0..4).for_each(|_| recording.hop());
        recording.restart(outage_us);
        (0..4).for_each(|_| recording.hop());
        for (frames, rate) in [
            (&recording.harness.recorder.raw, 512.0),
            (&recording.harness.recorder.filtered, 128.0),
        ] {
            let fillers = fillers(frames);
            let before = fillers.iter().position(|filler| *filler).unwrap();
            let missing = fillers.iter().filter(|filler| **filler).count();
            assert_eq!(before as f64, 0.25 * rate);
            assert_eq!(missing as f64, (outage_us as f64 * rate / 1e6).round(), "{outage_us}");
        }
    }
}

#[test]
fn after_a_restart_at_any_phase_of_a_frame_all_stamps_are_on_one_line() {
    let points = [StampPoint::First, StampPoint::Last];
    for (phase, stamp) in (0..4).flat_map(|phase| points.map(|stamp| (phase, stamp))) {
        for outage_us in [130_000, 1_234_567] {
            let mut recording = Recording::new(Settings { stamp, ..SAMPLES });
            (0..960).for_each(|_| recording.hop());
            recording.messages(phase);
            recording.restart(outage_us);
            (0..32).for_each(|_| recording.hop());
            let recorder = &recording.harness.recorder;
            // A gap is rounded to a whole number of samples, steps or codes.
            for (topic, frames, period_ns) in [
                ("encoded", &recorder.encoded, 62_500_000),
                ("raw", &recorder.raw, 1_953_125),
                ("filtered", &recorder.filtered, 7_812_500),
            ] {
                let stamps = stamps(frames);
                for (frame, stamp_ns) in (0..).zip(&stamps) {
                    let off_ns = stamp_ns - (stamps[0] + frame * 62_500_000);
                    assert!(
                        off_ns.abs() <= period_ns / 2 + 20_000,
                        "{topic}, phase {phase}, {stamp:?}, frame {frame}: {off_ns} ns"
                    );
                }
            }
        }
    }
}

#[test]
fn the_time_in_which_another_device_is_refused_is_filled() {
    let mut recording = Recording::new(SAMPLES);
    (0..16).for_each(|_| recording.hop());
    let harness = &mut recording.harness;
    harness.core.disconnected();
    let first = std::mem::replace(&mut harness.board, Board::of_another_shape());
    harness.connect();
    harness.codes(16, 1);
    harness.core.disconnected();
    harness.board = first;
    harness.board.reboot();
    harness.connect();
    recording.run_us = recording.harness.now_us;
    recording.hops = 0;
    recording.hop();
    // 16 hops pass while the other device is connected. The next hop's code is the first of the new
    // run, so 16 codes are missing.
    assert_eq!(recording.harness.core.summary().between_runs, 16);
    assert_eq!(recording.harness.recorder.encoded.len(), 16 + 16 + 1);
}

#[test]
fn a_pause_by_the_user_is_not_filled() {
    let mut recording = Recording::new(SAMPLES);
    (0..5).for_each(|_| recording.hop());
    let harness = &mut recording.harness;
    harness.set_streaming(false);
    harness.now_us += 10_000_000;
    harness.set_streaming(true);
    // During the pause the device's clock went on. The indices of its codes start at 0 again.
    let device_us = harness.board.now_us + 10_000_000 + HOP_US as u64;
    harness.now_us += HOP_US;
    let code = harness.board.code(device_us, 1);
    harness.receive(&code);
    let summary = harness.core.summary();
    assert_eq!((summary.between_runs, summary.lost, summary.fillers), (0, 0, 0));
    assert_eq!(harness.recorder.encoded.len(), 6);
}

#[test]
fn a_gap_that_only_an_event_has_shown_is_not_counted_when_the_user_stops() {
    let mut recording = Recording::new(Settings {
        announced: AnnouncedStream::Raw,
        streams: SAMPLES.streams | Streams::EVENTS,
        ..SAMPLES
    });
    (0..4).for_each(|_| recording.hop());
    recording.restart(1_000_000);
    let harness = &mut recording.harness;
    let edge = ToHost::Event(Event { kind: EventKind::TriggerRise, number: 0, sample: 0 });
    harness.send(0, &edge);
    let missing = "raw samples missing between runs";
    assert_eq!(harness.figure("loss", missing), "512");
    harness.set_streaming(false);
    assert_eq!(harness.figure("loss", missing), "0");
}

#[test]
fn without_fillers_a_restart_is_counted_and_nothing_is_published_for_it() {
    let settings = Settings { filler: FillerPolicy::Off, ..SAMPLES };
    let mut recording = Recording::new(settings);
    (0..4).for_each(|_| recording.hop());
    recording.restart(1_000_000);
    (0..4).for_each(|_| recording.hop());
    let summary = recording.harness.core.summary();
    assert_eq!((summary.between_runs, summary.fillers), (16, 0));
    assert_eq!(recording.harness.recorder.encoded.len(), 8);
    assert!(!fillers(&recording.harness.recorder.raw).contains(&true));
}

#[test]
fn a_code_that_is_lost_after_a_restart_is_counted_apart() {
    let mut recording = Recording::new(SETTINGS);
    recording.harness.codes(4, 1);
    recording.harness.reboot(1_000_000);
    recording.harness.code(1, true);
    recording.harness.stats(Streams::CODES);
    recording.harness.code(1, false);
    let summary = recording.harness.core.summary();
    assert_eq!((summary.lost, summary.between_runs, summary.fillers), (1, 16, 17));
    let lost = recording.harness.recorder.encoded.last().unwrap().tri.data[6];
    assert_eq!(lost, 17);
}
