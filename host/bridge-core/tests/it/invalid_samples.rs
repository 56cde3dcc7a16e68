//! Samples that do not match the device's capabilities, that restart, or that were not requested.

use link::{Filtered, Flags, Raw, ToHost};

use crate::recorder::{SETTINGS, value};
use crate::samples::{SAMPLES, counts, harness, send_samples, send_samples_at};

#[test]
fn samples_that_do_not_match_the_device_are_counted_and_not_published() {
    let mut harness = harness(SAMPLES);
    let good = counts(0, 8, 64);
    for (channels, bytes) in [
        (64, &good[..good.len() - 1]),
        (64, &good[..64]),
        (63, &good[..63 * 3]),
        (0, &good[..0]),
        (0, &good[..64]),
        (64, &good[..0]),
        (255, &good[..255]),
    ] {
        let raw = Raw {
            first_sample: 0,
            channels,
            flags: Flags::empty(),
            counts: bytes,
        };
        harness.send(2_000_000, &ToHost::Raw(raw));
    }
    for (first_sample, electrodes) in [(u64::MAX, 64), (u64::MAX - 7, 64)] {
        let raw = Raw {
            first_sample,
            channels: electrodes,
            flags: Flags::empty(),
            counts: &good,
        };
        harness.send(2_000_000, &ToHost::Raw(raw));
    }
    for (electrodes, values) in [
        (61, &good[..61 * 4 + 2]),
        (60, &good[..240]),
        (0, &good[..0]),
    ] {
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
    let status = harness.status("loss").unwrap();
    let figure = |key: &str| {
        let pair = status.values.iter().find(|pair| pair.key == key).unwrap();
        pair.value.clone()
    };
    assert_eq!(figure("raw samples messages malformed"), "9");
    assert_eq!(figure("filtered steps messages malformed"), "3");
    assert_eq!(figure("raw samples received"), "0");
    assert!(harness.recorder.raw.is_empty());
    // The device's codes are still accepted after its invalid samples.
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
    let status = harness.status("loss").unwrap();
    let mut values = status.values.iter();
    let unpublished = values.find(|pair| pair.key == "raw samples not published");
    assert_eq!(
        unpublished.unwrap().value,
        "24",
        "samples of the unfinished frame"
    );
    harness.set_streaming(true);
    for first in [0, 8, 16, 24] {
        send_samples_at(
            &mut harness,
            3_000_000 + first * 1953,
            first,
            Flags::empty(),
        );
    }
    assert_eq!(harness.recorder.raw.len(), 1);
    assert!(
        harness.recorder.raw[0]
            .tri
            .data
            .iter()
            .step_by(8)
            .all(|flags| *flags == 0)
    );
}

#[test]
fn samples_that_were_not_requested_are_counted() {
    let mut harness = harness(SETTINGS);
    send_samples(&mut harness, 0, Flags::empty());
    let status = harness.status("device").unwrap();
    assert_eq!(value(&status, "other messages unused"), "1");
}

#[test]
fn stamps_that_were_moved_forwards_are_counted() {
    let mut harness = harness(SAMPLES);
    for first in (0..32).step_by(8) {
        send_samples(&mut harness, first, Flags::empty());
    }
    // The next samples carry device time 1 s, although the previous samples carry times from 2 s
    // on.
    for first in (32..64).step_by(8) {
        send_samples_at(&mut harness, 1_000_000, first, Flags::empty());
    }
    assert_eq!(harness.recorder.raw.len(), 2);
    let status = harness.status("clock").unwrap();
    assert_eq!(value(&status, "stamps held"), "1");
}
