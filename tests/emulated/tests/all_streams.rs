//! All streams at once, with a bouncing trigger input: the board sends what host-sim sends, and every event.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use emulated::board::{APPLICATION, boards};
use emulated::frames::{self, Boot};
use emulated::input::Input;
use emulated::stages::{self, Stages};
use emulated::trigger::{self, Triggers};
use emulated::{compare, host};
use link::{Stats, Streams, ToHost};
use model::{ADC_RATE_HZ, CELLS, CHANNELS, STEPS};
use pipeline::{Encoder, Sample, Step};
use serde_json::json;

const TEST: &str = "all streams of the emulated application";

/// Number of samples: 31 s, which is enough for four audits. They are taken from the middle of the
/// input, where the real recording starts. The number is a multiple of the samples in a frame.
const SAMPLES: usize = 15_872;

/// Largest number of samples by which the board's counters of the acquisition can be ahead of
/// host-sim's: the samples that wait for the encoder.
const MAX_AHEAD: u64 = 16;

#[test]
fn all_streams_at_once_equal_host_sims() {
    let input = Input::from_environment();
    let skip = input.samples.len().saturating_sub(SAMPLES) / 2;
    let samples = &input.samples[skip..input.samples.len().min(skip + SAMPLES)];
    let expected = host::sent(Streams::ALL, samples);
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("all-streams", samples);
        let edges = trigger::edges(samples.len());
        let bytes: Vec<u8> = edges.iter().flat_map(|edge| edge.to_le_bytes()).collect();
        scenario.write(trigger::FILE, &bytes);
        let run = scenario.run(&["start-all", "trigger"], "uart");
        let boot = Boot::only(&run.sent);
        let triggers = Triggers::new(&run.sent, edges);
        let stages = Stages::from_last(&boot.timing);
        let outputs = Output::all(&run.sent);
        let count = |kind| outputs.iter().filter(|output| output.kind == kind).count();
        let difference = first_difference(&Output::all(&expected), &outputs);
        let raw = raw_samples(&run.sent);
        let seconds = samples.len() / usize::from(ADC_RATE_HZ);
        let figures = json!({
            "equal": difference.is_none() && raw == samples,
            "codes": count("code"),
            "raw_frames": count("raw samples"),
            "filtered_frames": count("filtered steps"),
            "reports": count("report"),
            "audits": count("audit"),
            "raw_samples": raw.len(),
            "overruns": run.overruns(&boot),
            "frames_dropped": boot.last_stats().frames_dropped,
            "bytes": run.sent.len(),
            "bytes_per_second": run.sent.len() / seconds.max(1),
            "triggers": triggers.counts(),
            "stages": stages,
        });
        board.record(&json!({"all_streams": figures}));
        check(&run.sent, samples, &expected);
        run.assert_complete(&boot, samples.len());
        triggers.assert_right();
        stages.assert_within(stages::LIMIT_BUSY);
    }
}

/// Checks the outputs and counters, which host-sim sends, too.
fn check(sent: &[u8], samples: &[Sample], expected: &[u8]) {
    let difference = first_difference(&Output::all(expected), &Output::all(sent));
    assert_eq!(difference, None, "an output is not host-sim's");
    let audits = audits(sent);
    assert!(
        !audits.is_empty() && audits.iter().all(|sound| *sound),
        "{audits:?}: false for each audit whose code is not that of its planes"
    );
    let raw = raw_samples(sent);
    let counts = (raw.len(), samples.len());
    assert!(
        raw == samples,
        "raw samples are not the input's: {counts:?}"
    );
    let [expected, found] = [expected, sent].map(|sent| Boot::only(sent).stats);
    let difference = first_different_count(&expected, &found);
    assert_eq!(difference, None, "Stats are not host-sim's");
}

/// A frame with output of the pipeline, without its sequence number.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Output {
    kind: &'static str,
    /// Device time in microseconds.
    at_us: u64,
    /// The message as bytes, encoded by [`frames::encoded`].
    bytes: Vec<u8>,
}

impl Output {
    /// Collects the outputs in order. Events are left out: host-sim has no trigger here.
    fn all(sent: &[u8]) -> Vec<Self> {
        let mut all = Vec::new();
        frames::for_each(sent, |header, message| {
            let kind = match message {
                ToHost::Code(_) => "code",
                ToHost::Quality(_) => "report",
                ToHost::Raw(_) => "raw samples",
                ToHost::Filtered(_) => "filtered steps",
                ToHost::Audit(_) => "audit",
                _ => return,
            };
            all.push(Self {
                kind,
                at_us: header.device_time_us,
                bytes: frames::encoded(message),
            });
        });
        all
    }
}

/// Describes the first output that differs in its kind, its content, or its time since the first output; `None` where
/// all are equal.
fn first_difference(expected: &[Output], found: &[Output]) -> Option<String> {
    let start_us = |all: &[Output]| all.first().map_or(0, |output| output.at_us);
    let starts_us = [start_us(expected), start_us(found)];
    for (index, (expected, found)) in expected.iter().zip(found).enumerate() {
        let due_us = expected.at_us.wrapping_sub(starts_us[0]);
        let at_us = found.at_us.wrapping_sub(starts_us[1]);
        let kind = found.kind;
        if expected.kind != kind {
            return Some(format!(
                "frame {index} is of {kind}, not of {}",
                expected.kind
            ));
        }
        if expected.bytes != found.bytes {
            return Some(format!("frame {index}, {kind}, has other content"));
        }
        if due_us != at_us {
            return Some(format!(
                "frame {index}, {kind}, is at {at_us} us, not {due_us}"
            ));
        }
    }
    let [expected, found] = [expected.len(), found.len()];
    (expected != found).then(|| format!("{found} frames, {expected} expected"))
}

/// Returns for each audit whether its code equals the one that the encoder computes from its planes, and the one that
/// was sent for its window.
fn audits(sent: &[u8]) -> Vec<bool> {
    let mut codes = HashMap::new();
    let mut sound = Vec::new();
    frames::for_each(sent, |_, message| match message {
        ToHost::Code(code) => {
            codes.insert(code.window, code.values);
        }
        ToHost::Audit(audit) => {
            let planes = audit.planes.as_chunks::<CELLS>().0;
            let mut encoder = Encoder::new();
            let code = planes.iter().fold(None, |_, plane| {
                encoder.encode_step(&Step {
                    plane: plane.map(u8::cast_signed),
                    ..Step::SILENCE
                })
            });
            sound.push(
                planes.len() == STEPS
                    && code.map(|code| to_link(&code.values)) == Some(audit.values)
                    && codes.get(&audit.window) == Some(&audit.values),
            );
        }
        _ => {}
    });
    sound
}

/// Converts the values of a code to the link's type.
fn to_link(values: &pipeline::CodeValues) -> link::CodeValues {
    match *values {
        pipeline::CodeValues::Int8(values) => link::CodeValues::Int8(values),
        pipeline::CodeValues::Int8Exponent { exponent, values } => {
            link::CodeValues::Int8Exponent { exponent, values }
        }
        pipeline::CodeValues::Int16(values) => link::CodeValues::Int16(values),
    }
}

/// Collects the samples of the raw frames up to the first gap.
fn raw_samples(sent: &[u8]) -> Vec<Sample> {
    let mut samples = Vec::new();
    frames::for_each(sent, |_, message| {
        if let ToHost::Raw(raw) = message
            && raw.first_sample == samples.len() as u64
        {
            let counts: Vec<i32> = raw.counts().collect();
            let per_sample = counts.as_chunks::<CHANNELS>().0;
            samples.extend(per_sample.iter().map(|counts| Sample { counts: *counts }));
        }
    });
    samples
}

/// Describes the first counters that are not host-sim's. Those of the acquisition can be ahead by [`MAX_AHEAD`].
fn first_different_count(expected: &[Stats], found: &[Stats]) -> Option<String> {
    let found = found.iter().enumerate().map(|(index, found)| {
        let Some(expected) = expected.get(index) else {
            return *found;
        };
        let ahead = found.samples.wrapping_sub(expected.samples);
        if ahead > MAX_AHEAD || found.clipped < expected.clipped {
            return *found;
        }
        Stats {
            samples: expected.samples,
            clipped: expected.clipped,
            ..*found
        }
    });
    compare::first_difference(expected, &found.collect::<Vec<_>>())
}

mod checks {
    use emulated::refusal;
    use link::{Header, MAX_FRAME};

    use super::*;

    fn frame(header: Header, message: &ToHost<'_>) -> Vec<u8> {
        let mut buffer = [0; MAX_FRAME];
        let frame = link::encode(&header, message, &mut buffer);
        frame.expect("a frame").to_vec()
    }

    /// Replaces the frames for which `change` returns another one.
    fn changed(
        sent: &[u8],
        mut change: impl FnMut(Header, ToHost<'_>) -> Option<Vec<u8>>,
    ) -> Vec<u8> {
        let mut changed = Vec::new();
        frames::for_each(sent, |header, message| {
            let replaced = change(header, message.clone());
            changed.extend(replaced.unwrap_or_else(|| frame(header, message)));
        });
        changed
    }

    #[test]
    fn a_raw_count_and_a_counter_that_differ_are_refused() {
        let samples = Input::new(40).samples;
        let expected = host::sent(Streams::ALL, &samples);
        check(&expected, &samples, &expected);
        let wrong = changed(&expected, |header, message| match message {
            ToHost::Raw(mut raw) if raw.first_sample == 64 => {
                let mut counts = raw.counts.to_vec();
                counts[100] ^= 1;
                raw.counts = &counts;
                Some(frame(header, &ToHost::Raw(raw)))
            }
            _ => None,
        });
        assert!(raw_samples(&wrong) != samples);
        refusal::assert_refused("raw samples, has other content", || {
            check(&wrong, &samples, &expected);
        });
        let wrong = changed(&expected, |header, message| match message {
            ToHost::Stats(mut stats) => {
                stats.codes_made += 1;
                Some(frame(header, &ToHost::Stats(stats)))
            }
            _ => None,
        });
        refusal::assert_refused("Stats are not host-sim's", || {
            check(&wrong, &samples, &expected);
        });
    }

    #[test]
    fn an_audit_of_other_planes_is_refused_even_where_host_sim_sends_the_same() {
        let samples = Input::new(40).samples;
        let sent = host::sent(Streams::ALL, &samples);
        assert_eq!(audits(&sent), [true]);
        let wrong = changed(&sent, |header, message| match message {
            ToHost::Audit(mut audit) => {
                let mut planes = audit.planes.to_vec();
                planes[7 * CELLS + 40] ^= 0x40;
                audit.planes = &planes;
                Some(frame(header, &ToHost::Audit(audit)))
            }
            _ => None,
        });
        assert_eq!(audits(&wrong), [false]);
    }

    #[test]
    fn raw_samples_end_at_a_gap() {
        let samples = Input::new(40).samples;
        let sent = host::sent(Streams::ALL, &samples);
        assert!(raw_samples(&sent) == samples);
        let gap = changed(&sent, |_, message| match message {
            ToHost::Raw(raw) if raw.first_sample == 64 => Some(Vec::new()),
            _ => None,
        });
        assert!(raw_samples(&gap) == samples[..64]);
    }

    #[test]
    fn an_output_with_another_content_time_or_place_and_one_too_few_are_named() {
        let sent = host::sent(Streams::ALL, &vec![Sample::default(); 256]);
        let all = Output::all(&sent);
        assert!(all.iter().any(|output| output.kind == "audit"), "{all:?}");
        let found = |change: fn(&mut Vec<Output>)| {
            let mut changed = all.clone();
            change(&mut changed);
            first_difference(&all, &changed).unwrap_or_default()
        };
        assert_eq!(found(|_| ()), "");
        // A board that starts later is not refused.
        let later = |all: &mut Vec<Output>| all.iter_mut().for_each(|output| output.at_us += 9);
        assert_eq!(found(later), "");
        let late = found(|all| all[5].at_us += 1);
        assert!(late.starts_with("frame 5, "), "{late}");
        assert!(late.contains(" us, not "), "{late}");
        assert!(found(|all| all[3].bytes[9] ^= 1).ends_with("has other content"));
        assert!(found(|all| all.swap(1, 2)).starts_with("frame 1 is of"));
        assert!(found(|all| all.truncate(9)).starts_with("9 frames,"));
    }
}
