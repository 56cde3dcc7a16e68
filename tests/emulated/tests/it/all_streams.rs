//! Scenario with all streams at once and a bouncing trigger input: the board sends what host-sim
//! sends, and all trigger events except those of a burst that overflow the board's queue.

use emulated::board::boards;
use emulated::compare::first_difference;
use emulated::frames::{self, Boot, SentCode};
use emulated::input::Input;
use emulated::stages;
use link::{Event, EventKind, Stats, Streams, ToHost};
use model::{ADC_RATE_HZ, CELLS, CHANNELS, STEPS};
use pipeline::{Encoder, Step};
use serde_json::json;

/// Number of samples: 15.5 s, long enough for two audits, and a multiple of the samples in a frame.
/// They are from the middle of the input, where the real recording starts.
const SAMPLES: usize = 7_936;

/// Largest number of samples by which the board's `Stats` may be ahead of host-sim's: the board
/// also counts samples that the encoder has not read yet.
const MAX_AHEAD: u64 = 16;

#[test]
fn all_streams_of_the_network_at_once_equal_host_sims() {
    stream("start-all", "all_streams", Streams::ALL.without(Streams::PACKED));
}

#[test]
fn all_streams_of_the_packed_code_at_once_equal_host_sims() {
    let network = Streams::CODES | Streams::AUDIT;
    stream("start-packed", "packed_streams", Streams::ALL.without(network));
}

/// Runs the boards with `argument`, which makes the image start the streams `streams`, and checks
/// what the boards send. Records the figures as `name`.
fn stream(argument: &str, name: &str, streams: Streams) {
    let input = Input::from_environment();
    let skip = input.samples.len().saturating_sub(SAMPLES) / 2;
    let samples = &input.samples[skip..input.samples.len().min(skip + SAMPLES)];
    let expected = frames::simulated(streams, samples);
    let edges = Edges::new(samples.len());
    for board in boards(&name.replace('_', "-"), samples) {
        let bytes: Vec<_> = edges.at_us.iter().map(|us| us.to_le_bytes()).collect();
        board.write(TRIGGER_FILE, bytes.as_flattened());
        let run = board.run(&[argument, "trigger"], "uart");
        let boot = Boot::only(&run.sent);
        let outputs = outputs(&run.sent);
        let count = |kind| outputs.iter().filter(|output| output.0 == kind).count();
        let difference = first_difference(&self::outputs(&expected), &outputs);
        let raw = raw_counts(&run.sent);
        let is_raw_equal = samples.iter().flat_map(|sample| &sample.counts).eq(&raw);
        let events = events(&run.sent);
        // The first edge is at the first DRDY (data ready of the converter).
        let expected_events = edges.events(events.first().map_or(0, |(at_us, _)| *at_us));
        let mut received = events.iter().peekable();
        let lost =
            (0..).zip(&expected_events).filter(|(_, event)| received.next_if_eq(event).is_none());
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

/// Returns the messages in `sent` that carry outputs of the pipeline, each as kind, microseconds
/// after the first such message, and bytes from [`frames::encoded`]. Leaves out events, because
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

/// Returns whether each audit's code is right: equal to the code that the encoder computes from the
/// audit's planes, and to the code that was sent for its window.
fn audits(sent: &[u8], codes: &[SentCode]) -> Vec<bool> {
    frames::filter_map(sent, |_, message| {
        let ToHost::Audit(audit) = message else {
            return None;
        };
        let mut encoder = Encoder::new();
        let planes = audit.planes.as_chunks::<CELLS>().0.iter();
        let code = planes.fold(None, |_, plane| {
            encoder.encode_step(&Step { plane: plane.map(u8::cast_signed), ..Step::SILENCE })
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

/// Returns the ADC counts of all raw frames, one sample of all channels after the other.
fn raw_counts(sent: &[u8]) -> Vec<i32> {
    let frames = frames::filter_map(sent, |_, message| match message {
        ToHost::Raw(raw) => Some(raw.counts().collect::<Vec<_>>()),
        _ => None,
    });
    frames.concat()
}

/// Returns a text on the first `Stats` that differ from host-sim's, or `None`. The number of
/// acquired samples may be ahead by up to [`MAX_AHEAD`], and the number of clipped values by any
/// amount.
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

/// Returns the events in `sent`, each with its device time in microseconds.
fn events(sent: &[u8]) -> Vec<(u64, Event)> {
    frames::filter_map(sent, |header, message| match message {
        ToHost::Event(event) => Some((header.device_time_us, event)),
        _ => None,
    })
}

/// Name of the file with the trigger's edges in the image's folder: microseconds after the first
/// DRDY, 64 bits each, little endian.
const TRIGGER_FILE: &str = "trigger.u64";

/// Smallest number of samples that last whole microseconds: at 512 Hz, eight last 15 625 us.
const WHOLE_SAMPLES: u64 = 8;
const WHOLE_US: u64 = WHOLE_SAMPLES * 1_000_000 / ADC_RATE_HZ as u64;
const _: () = assert!((WHOLE_SAMPLES * 1_000_000).is_multiple_of(ADC_RATE_HZ as u64));

/// Number of samples from one group of trigger edges to the next: 104, a fifth of a second. It is
/// no multiple of the 64 samples of a window, so that the groups fall at different positions in
/// windows.
const GROUP_PERIOD: u64 = 13 * WHOLE_SAMPLES;

/// Number of groups of edges from one burst of edges to the next.
const BURST_PERIOD: u64 = 40;

/// Number of edges in a burst: more than the 16 events that the board's queue can hold
/// (`firmware::deadlines::EVENTS_WAITING`).
const BURST_EDGES: usize = 24;

/// Smallest number of events that a board must send for a burst. Its queue holds 16 events, but the
/// events of the three edges around the preceding DRDY can take up to three slots while they wait
/// for the busy encoder.
const BURST_KEPT: usize = 13;

/// Time between two edges of a burst, microseconds. A whole burst fits between two DRDYs.
const BOUNCE_US: usize = 20;

/// Edges at the trigger input, which rise and fall in turn.
#[derive(Debug, Default)]
struct Edges {
    /// Times of the edges, in microseconds after the first DRDY.
    at_us: Vec<u64>,
    /// For each burst, the index of its first edge in `at_us`.
    bursts: Vec<usize>,
}

impl Edges {
    /// Returns edges for `samples` samples. The first edge is at the first DRDY, the second 100 us
    /// later. Groups of four edges follow: 1 us before a DRDY, at that DRDY, 1 us after it, and in
    /// the middle between two later DRDYs. In some groups, a burst replaces the fourth edge.
    fn new(samples: usize) -> Self {
        let mut at_us = vec![0, 100];
        let mut bursts = Vec::new();
        for group in 1..(samples as u64 / GROUP_PERIOD) {
            let drdy = group * GROUP_PERIOD / WHOLE_SAMPLES * WHOLE_US;
            at_us.extend([drdy - 1, drdy, drdy + 1]);
            if group % BURST_PERIOD == BURST_PERIOD / 2 {
                bursts.push(at_us.len());
                let burst = (drdy + 200..).step_by(BOUNCE_US);
                at_us.extend(burst.take(BURST_EDGES));
            } else {
                at_us.push(drdy + 5 * WHOLE_US / (2 * WHOLE_SAMPLES));
            }
        }
        Self { at_us, bursts }
    }

    /// Returns the events that a board must send if its first DRDY was at `origin_us`, each with
    /// its device time in microseconds.
    ///
    /// An event belongs to the first sample whose DRDY is at or after the edge. Rounding does not
    /// change this sample: edges are close to a DRDY only where the DRDY is at a whole microsecond.
    fn events(&self, origin_us: u64) -> Vec<(u64, Event)> {
        let kinds = [EventKind::TriggerRise, EventKind::TriggerFall].into_iter();
        let edges = (0..).zip(&self.at_us).zip(kinds.cycle());
        let events = edges.map(|((number, at_us), kind)| {
            let event = Event {
                kind,
                number,
                sample: (at_us * u64::from(ADC_RATE_HZ)).div_ceil(1_000_000),
            };
            (origin_us + at_us, event)
        });
        events.collect()
    }

    /// Returns whether a board may lose exactly the events of the edges `lost` (indices in
    /// `at_us`): of each burst at least one event and at most as many as overflow the board's
    /// queue, and no event outside the bursts.
    fn may_lack(&self, lost: &[usize]) -> bool {
        let in_burst = |first: &usize| {
            let burst = *first..first + BURST_EDGES;
            lost.iter().filter(|number| burst.contains(number)).count()
        };
        let in_bursts: Vec<usize> = self.bursts.iter().map(in_burst).collect();
        let right = 1..=BURST_EDGES - BURST_KEPT;
        in_bursts.iter().all(|count| right.contains(count))
            && in_bursts.iter().sum::<usize>() == lost.len()
    }
}

#[test]
fn edges_are_before_at_and_after_samples_and_some_in_bursts_that_do_not_fit() {
    let edges = Edges::new(10_000);
    assert!(edges.at_us.is_sorted_by(|a, b| a < b));
    let events = edges.events(0).into_iter().take(6);
    // Expected samples: 0 for the edge at the first DRDY, 1 for the edge 100 us later. The group at
    // sample 104 follows: 104 for the edges before and at its DRDY, 105 for the edge after it, 107
    // for the edge between two later DRDYs.
    let samples: Vec<u64> = events.map(|(_, event)| event.sample).collect();
    assert_eq!(samples, [0, 1, 104, 104, 105, 107]);
    assert_eq!(edges.bursts.len(), 2);
}

#[test]
fn only_edges_of_bursts_may_be_lost_and_not_all_of_them() {
    let edges = Edges::new(10_000);
    let [first, second] = edges.bursts[..] else {
        panic!("{:?}", edges.bursts);
    };
    assert!(edges.may_lack(&[first + 13, second, second + 23]));
    assert!(!edges.may_lack(&[]), "no burst was too long");
    assert!(!edges.may_lack(&[11, first, second]), "there was room");
    let many: Vec<usize> = (first..first + 12).chain([second]).collect();
    assert!(!edges.may_lack(&many), "there was room");
}
