//! Samples that do not match the device's capabilities, begin a new stream, were not requested, or
//! have an earlier device time than the samples before them.

use link::{Filtered, Flags, Raw, ToHost};

use crate::recorder::{SETTINGS, fillers};
use crate::samples::{SAMPLES, counts, harness, send_samples, send_samples_at};

#[test]
fn samples_that_do_not_match_the_device_are_counted_and_not_published() {
    let mut harness = harness(SAMPLES);
    let good = counts(0, 8, 64);
    for (first_sample, channels, counts) in [
        (0, 64, &good[..good.len() - 1]),
        (0, 64, &good[..64]),
        (0, 63, &good[..63 * 3]),
        (0, 0, &good[..0]),
        (0, 0, &good[..64]),
        (0, 64, &good[..0]),
        (0, 255, &good[..255]),
        (u64::MAX, 64, &good),
        (u64::MAX - 7, 64, &good),
    ] {
        let raw = Raw { first_sample, channels, flags: Flags::empty(), counts };
        harness.send(2_000_000, &ToHost::Raw(raw));
    }
    for (electrodes, values) in [(61, &good[..61 * 4 + 2]), (60, &good[..240]), (0, &good[..0])] {
        let filtered = Filtered {
            first_step: 0,
            electrodes,
            fraction_bits: 200,
            flags: Flags::empty(),
            values,
        };
        harness.send(2_000_000, &ToHost::Filtered(filtered));
    }
    assert!(harness.recorder.filtered.is_empty());
    for (key, expected) in [
        ("raw samples messages malformed", "9"),
        ("filtered steps messages malformed", "3"),
        ("raw samples received", "0"),
    ] {
        assert_eq!(harness.figure("loss", key), expected, "{key}");
    }
    assert!(harness.recorder.raw.is_empty());
    // After its invalid samples, the device's codes are still accepted.
    harness.code(1, false);
    assert_eq!(harness.core.summary().received, 2);
}

#[test]
fn a_restarted_stream_starts_a_new_frame() {
    let mut harness = harness(SAMPLES);
    for first in [0, 8, 16] {
        send_samples(&mut harness, first, Flags::empty());
    }
    harness.set_streaming(false);
    let unpublished = harness.figure("loss", "raw samples not published");
    assert_eq!(unpublished, "24", "samples of the unfinished frame");
    harness.set_streaming(true);
    for first in [0, 8, 16, 24] {
        let us = 3_000_000 + first * 1953;
        send_samples_at(&mut harness, us, first, Flags::empty());
    }
    assert_eq!(fillers(&harness.recorder.raw), [false; 32]);
}

#[test]
fn samples_that_were_not_requested_are_counted() {
    let mut harness = harness(SETTINGS);
    send_samples(&mut harness, 0, Flags::empty());
    assert_eq!(harness.figure("device", "other messages unused"), "1");
}

#[test]
fn stamps_that_were_moved_forwards_are_counted() {
    let mut harness = harness(SAMPLES);
    for first in (0..32).step_by(8) {
        send_samples(&mut harness, first, Flags::empty());
    }
    // These samples carry the device time 1 s, although those before them carry times from 2 s on.
    for first in (32..64).step_by(8) {
        send_samples_at(&mut harness, 1_000_000, first, Flags::empty());
    }
    assert_eq!(harness.recorder.raw.len(), 2);
    assert_eq!(harness.figure("clock", "stamps held"), "1");
}
