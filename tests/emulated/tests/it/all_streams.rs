//! All streams of an encoder at once, with a bouncing trigger input: the board sends what host-sim
//! sends, and every event.

use emulated::board::boards;
use emulated::compare::first_difference;
use emulated::frames::{self, Boot, SentCode};
use emulated::host;
use emulated::input::Input;
use emulated::stages;
use emulated::trigger::{self, Edges};
use link::{Event, Stats, Streams, ToHost};
use model::{ADC_RATE_HZ, CELLS, CHANNELS, STEPS};
use pipeline::{Encoder, Step};
use serde_json::json;

/// Number of samples: 31 s, long enough for four audits. The samples are taken from the middle of
/// the input, where the real recording starts. Their number is a multiple of the samples in a
/// frame.
const SAMPLES: usize = 15_872;

/// Largest number of samples by which the board's `Stats` can be ahead of host-sim's: the board
/// counts samples that still wait for the encoder.
const MAX_AHEAD: u64 = 16;

#[test]
fn all_streams_of_the_network_at_once_equal_host_sims() {
    stream(
        "start-all",
        "all_streams",
        Streams::ALL.without(Streams::PACKED),
    );
}

#[test]
fn all_streams_of_the_packed_code_at_once_equal_host_sims() {
    let network = Streams::CODES | Streams::AUDIT;
    stream(
        "start-packed",
        "packed_streams",
        Streams::ALL.without(network),
    );
}

/// Runs the boards with streams that the image starts with `argument`, and records the figures as
/// `name`.
fn stream(argument: &str, name: &str, streams: Streams) {
    let input = Input::from_environment();
    let skip = input.samples.len().saturating_sub(SAMPLES) / 2;
    let samples = &input.samples[skip..input.samples.len().min(skip + SAMPLES)];
    let expected = host::sent(streams, samples);
    let edges = Edges::new(samples.len());
    for board in boards(&name.replace('_', "-"), samples) {
        let bytes: Vec<_> = edges.at_us.iter().map(|us| us.to_le_bytes()).collect();
        board.write(trigger::FILE, bytes.as_flattened());
        let run = board.run(&[argument, "trigger"], "uart");
        let boot = Boot::only(&run.sent);
        let outputs = outputs(&run.sent);
        let count = |kind| outputs.iter().filter(|output| output.0 == kind).count();
        let difference = first_difference(&self::outputs(&expected), &outputs);
        let raw = raw_counts(&run.sent);
        let is_raw_equal = samples.iter().flat_map(|sample| &sample.counts).eq(&raw);
        let events = events(&run.sent);
        // The first edge is at the first DRDY.
        let expected_events = edges.events(events.first().map_or(0, |(at_us, _)| *at_us));
        let mut received = events.iter().peekable();
        let lost = (0..)
            .zip(&expected_events)
            .filter(|(_, event)| received.next_if_eq(event).is_none());
        let lost: Vec<usize> = lost.map(|(number, _)| number).collect();
        board.record(&json!({name: {
            "equal": difference.is_none() && is_raw_equal,
            "codes": count("code"),
            "packed_blocks": count("packed block"),
            "raw_frames": count("raw samples"),
            "compressed_frames": count("compressed samples"),
            "filtered_frames": count("filtered steps"),
            "reports": count("report"),
            "audits": count("audit"),
            "raw_samples": raw.len() / CHANNELS,
            "overruns": run.overruns(&boot),
            "frames_dropped": boot.last_stats().frames_dropped,
            "bytes": run.sent.len(),
            "bytes_per_second": run.sent.len() / (samples.len() / usize::from(ADC_RATE_HZ)).max(1),
            "triggers": {"edges": edges.at_us.len(), "events": events.len(), "lost": lost.len()},
            "stages": stages::figures(&boot.timing),
        }}));
        assert_eq!(difference, None, "an output is not host-sim's");
        assert!(is_raw_equal, "raw samples are not the input's");
        let audits = audits(&run.sent, &boot.codes());
        let kinds = [
            ("code", Streams::CODES),
            ("packed block", Streams::PACKED),
            ("audit", Streams::AUDIT),
        ];
        for (kind, stream) in kinds {
            assert_eq!(count(kind) > 0, streams.contains(stream), "{kind}");
        }
        assert!(!audits.contains(&false), "is each audit sound? {audits:?}");
        let counters = first_different_stats(&boot.stats, &Boot::only(&expected).stats);
        assert_eq!(counters, None, "Stats are not host-sim's");
        run.assert_complete(&boot, samples.len());
        let wrong = received.next();
        assert_eq!(wrong, None, "time, kind, sample or order of an event");
        assert!(edges.may_lack(&lost), "there was room for events {lost:?}");
        stages::assert_within(stages::LIMIT_BUSY, &boot.timing);
    }
}

/// Collects the messages with output of the pipeline, in order: kind, device time in microseconds
/// after the first of them, and bytes from [`frames::encoded`]. Events are left out, because
/// host-sim has no trigger here.
fn outputs(sent: &[u8]) -> Vec<(&'static str, u64, Vec<u8>)> {
    let mut first_us = None;
    frames::filter_map(sent, |header, message| {
        let kind = match message {
            ToHost::Code(_) => "code",
            ToHost::PackedCode(_) => "packed block",
            ToHost::Quality(_) => "report",
            ToHost::Raw(_) => "raw samples",
            ToHost::CompressedRaw(_) => "compressed samples",
            ToHost::Filtered(_) => "filtered steps",
            ToHost::Audit(_) => "audit",
            _ => return None,
        };
        let at_us = header.device_time_us;
        let after_us = at_us.wrapping_sub(*first_us.get_or_insert(at_us));
        Some((kind, after_us, frames::encoded(&message)))
    })
}

/// Returns for each audit whether its code equals two others: the code that the encoder computes
/// from the audit's planes, and the code that was sent for its window.
fn audits(sent: &[u8], codes: &[SentCode]) -> Vec<bool> {
    frames::filter_map(sent, |_, message| {
        let ToHost::Audit(audit) = message else {
            return None;
        };
        let mut encoder = Encoder::new();
        let planes = audit.planes.as_chunks::<CELLS>().0.iter();
        let code = planes.fold(None, |_, plane| {
            encoder.encode_step(&Step {
                plane: plane.map(u8::cast_signed),
                ..Step::SILENCE
            })
        });
        let levels = code.map(|code| code.values.levels().to_vec());
        let theirs: Vec<i32> = audit.values.levels().collect();
        let sent = codes.iter().find(|code| code.window == audit.window);
        Some(
            audit.planes.len() == STEPS * CELLS
                && levels.as_ref() == Some(&theirs)
                && sent.map(|code| &code.levels) == Some(&theirs),
        )
    })
}

/// Returns the counts of all channels in the raw frames, one sample after the other.
fn raw_counts(sent: &[u8]) -> Vec<i32> {
    let frames = frames::filter_map(sent, |_, message| match message {
        ToHost::Raw(raw) => Some(raw.counts().collect::<Vec<_>>()),
        _ => None,
    });
    frames.concat()
}

/// Describes the first `Stats` that differ from host-sim's. Counts of acquired samples may be ahead
/// by [`MAX_AHEAD`].
fn first_different_stats(found: &[Stats], expected: &[Stats]) -> Option<String> {
    let mut found = found.to_vec();
    for (found, expected) in found.iter_mut().zip(expected) {
        let ahead = found.samples.wrapping_sub(expected.samples);
        if ahead <= MAX_AHEAD && found.clipped >= expected.clipped {
            (found.samples, found.clipped) = (expected.samples, expected.clipped);
        }
    }
    first_difference(expected, &found)
}

/// Collects the events with their device times in microseconds.
fn events(sent: &[u8]) -> Vec<(u64, Event)> {
    frames::filter_map(sent, |header, message| match message {
        ToHost::Event(event) => Some((header.device_time_us, event)),
        _ => None,
    })
}
