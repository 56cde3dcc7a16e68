//! `corticode-node --source lsl` encodes streams from pylsl, with jitter, gaps and restarts, and
//! refuses a name that two streams have.

mod session;

use std::collections::BTreeMap;
use std::fs;
use std::time::Duration;

use acceptance::lsl_recording::unique;
use acceptance::programs::programs;
use acceptance::ros::{Ros, TIMEOUT};
use acceptance::wheels::{self, liblsl};
use neuro_ros::ros1::Subscriber;
use neuro_ros::{DiagnosticArray, Wire};
use rustix::process::Signal;

use self::session::{Published, Session, play};
use crate::node_chain::{EXIT_TIMEOUT, Eeg, SAMPLES, block_on, is_filler, start_node, subscribe};

/// First missing sample, in the middle of a frame, and first sample after the gap.
const GAP: [usize; 2] = [3005, 4003];
/// Number of samples that each of two senders sends, one sender after the other.
const HALF: usize = 3072;
/// True rate of the senders, whose clocks are fast by 200 ppm, Hz.
const SENT_HZ: f64 = model::ADC_RATE_HZ as f64 * 1.000_2;
/// First sample after the sender's restart.
const RESTART: usize = 3000;
/// Number of hops in the window of a code. A frame lasts a hop.
const HOPS: usize = model::STEPS / model::HOP;

impl Eeg {
    /// Returns only the samples from `from` up to, not including, `to`.
    fn part(&self, from: usize, to: usize) -> Eeg {
        let channels = self.labels.len();
        Eeg { values: self.values[from * channels..to * channels].to_vec(), ..self.clone() }
    }

    fn samples(&self) -> usize {
        self.values.len() / self.labels.len()
    }

    /// Returns all samples, with samples `from` to `to` - 1 replaced by the sample before `from`.
    fn held(&self, from: usize, to: usize) -> Eeg {
        let channels = self.labels.len();
        let mut held = self.clone();
        for sample in from..to {
            held.values.copy_within((from - 1) * channels..from * channels, sample * channels);
        }
        held
    }
}

/// Returns, by stream, the values in the newest status `source` that `diagnostics` has received.
async fn last_values(diagnostics: &mut Subscriber) -> BTreeMap<String, BTreeMap<String, String>> {
    let mut last = BTreeMap::new();
    let wait = Duration::from_millis(100);
    while let Ok(Some(body)) = tokio::time::timeout(wait, diagnostics.recv()).await {
        let report = DiagnosticArray::from_bytes(&body).expect("a report");
        let sources = report.status.into_iter().filter(|status| status.name.ends_with(": source"));
        for status in sources {
            let values = status.values.into_iter().map(|value| (value.key, value.value));
            let values: BTreeMap<String, String> = values.collect();
            last.insert(values["topic"].clone(), values);
        }
    }
    last
}

#[test]
fn codes_of_irregular_and_interrupted_streams_are_those_of_host_sim_bit_for_bit() {
    let test = "streams of the Lab Streaming Layer to corticode-node";
    let Some(interpreter) = wheels::python(test) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    block_on(async {
        let ros = Ros::start_master_of(&programs().bridge, folder).expect("the master starts");
        let mut sessions = Vec::new();
        for name in ["even", "gap", "restart", "return"] {
            sessions.push(Session::start(&ros, &interpreter, folder, name).await);
        }
        let node = &sessions[0].node;
        let topic = "/diagnostics";
        let (_listener, mut diagnostics) = subscribe::<DiagnosticArray>(&ros, topic, node).await;
        let eeg = Eeg::synthetic();
        let halves = [eeg.part(0, HALF), eeg.part(HALF, 2 * HALF)];
        let (omit, restart) = (format!("omit={}:{}", GAP[0], GAP[1]), format!("restart={RESTART}"));
        let start = |session: usize, eeg: &Eeg, option: &str| {
            let options = ["jitter=0.0005", "ppm=200", option];
            sessions[session].play(&interpreter, eeg, &options)
        };
        let players = [start(0, &eeg, "omit=0:0"), start(1, &eeg, &omit), start(2, &eeg, &restart)];
        let mut first_half = start(3, &halves[0], "omit=0:0");
        assert!(first_half.wait(TIMEOUT).success(), "{}", first_half.log());
        let second_half = start(3, &halves[1], "omit=0:0");
        let mut published = Vec::new();
        for (session, player) in sessions.into_iter().zip(players.into_iter().chain([second_half]))
        {
            published.push(session.finish(player).await);
        }
        check_even(&published[0], &expected(&eeg));
        check_gap(&published[1], &eeg);
        check_restart(&published[2], &eeg);
        check_return(&published[3], &halves);
        let last = last_values(&mut diagnostics).await;
        let missing_frames = GAP[1].div_ceil(SAMPLES) - GAP[0] / SAMPLES;
        for (published, lost, restarts) in [
            (&published[0], Some(0), 0),
            (&published[1], Some(missing_frames), 0),
            (&published[2], Some(0), 1),
            (&published[3], None, 0),
        ] {
            let values = &last[&format!("lsl:name={}", published.stream)];
            let count = |key: &str| values[key].parse::<usize>().expect("a number");
            let lost = lost.unwrap_or_else(|| count_fillers(published) - HOPS);
            assert_eq!(count("frames lost"), lost, "{values:?}");
            assert_eq!(count("restarts"), restarts, "{values:?}");
            for key in ["pauses", "frames refused", "frames dropped"] {
                assert_eq!(count(key), 0, "{values:?}");
            }
        }
    });
}

/// Returns the time of a sender's sample, in seconds after the sender's first sample.
fn sent_s(sample: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "some thousand")]
    let sample = sample as f64;
    sample / SENT_HZ
}

fn count_fillers(published: &Published) -> usize {
    published.frames.len() - published.codes().len()
}

fn check_even(published: &Published, expected: &[Vec<f32>]) {
    let codes = published.codes();
    assert_eq!(codes.len(), expected.len(), "{}", published.log);
    assert_eq!(count_fillers(published), 0, "{}", published.log);
    let mut worst_s: f64 = 0.0;
    for ((place, code), expected) in codes.into_iter().zip(expected) {
        assert_eq!(code, expected, "window {place}");
        let made_s = sent_s(place * SAMPLES);
        worst_s = worst_s.max(published.lateness_s(place, made_s).abs());
    }
    println!("jitter of 0.5 ms: stamps within {:.2} ms", worst_s * 1e3);
    assert!(worst_s < 1e-3, "{worst_s} s");
}

/// Returns the codes of host-sim for `eeg`.
fn expected(eeg: &Eeg) -> Vec<Vec<f32>> {
    let folder = tempfile::tempdir().expect("a folder");
    let samples = eeg.samples();
    // A GDF file holds whole seconds, so append zeros, and leave out their codes.
    let seconds = samples.div_ceil(eeg.rate_hz);
    let mut whole = eeg.clone();
    whole.values.resize(seconds * eeg.rate_hz * eeg.labels.len(), 0.0);
    let mut codes = whole.codes_of_host_sim(folder.path());
    codes.truncate((samples / SAMPLES + 1).saturating_sub(HOPS));
    codes
}

fn check_gap(published: &Published, eeg: &Eeg) {
    // A frame that lacks a sample is missing as a whole. During the missing frames, the last sample
    // before them remains at the filters' input.
    let (first, end) = (GAP[0] / SAMPLES, GAP[1].div_ceil(SAMPLES));
    let held = eeg.held(first * SAMPLES, end * SAMPLES);
    check_fillers(published, first, end - first, &expected(&held));
}

fn check_restart(published: &Published, eeg: &Eeg) {
    let parts = [eeg.part(0, RESTART), eeg.part(RESTART, eeg.samples())];
    let [before, after] = parts.map(|part| expected(&part));
    let codes = published.codes();
    assert_eq!(codes.len(), before.len() + after.len(), "{}", published.log);
    for ((place, code), expected) in codes.iter().zip(before.iter().chain(&after)) {
        assert_eq!(code, expected, "code {place}");
    }
    println!("restart: {} fillers", count_fillers(published));
    for warning in ["the acquisition started again", "are not those of LSL's clock"] {
        assert!(published.log.contains(warning), "{}", published.log);
    }
}

fn check_return(published: &Published, halves: &[Eeg; 2]) {
    let codes = published.codes();
    let (last, newest) = codes[codes.len() - 1];
    let lost = count_fillers(published) - HOPS;
    // The newest code ends with the last whole frame of the second half, so its stamp shows how
    // many samples follow this frame. Each half has a whole number of frames, so these samples and
    // those that the node has skipped at the start of the second half together fill whole frames.
    let made_s = sent_s(HALF - HOPS * SAMPLES);
    let after = -published.lateness_s(last, made_s) * SENT_HZ;
    println!("return: {lost} frames lost, {after:.2} samples after the last frame");
    let mut held = halves[0].clone();
    let samples = HALF + lost * SAMPLES;
    held.values.resize(samples * held.labels.len(), 0.0);
    let held = held.held(HALF, samples);
    // The node rounds the length of the gap to whole samples; try rounding down and rounding up.
    let expected = [after.floor(), after.ceil()].into_iter().find_map(|after| {
        #[expect(clippy::cast_possible_truncation, reason = "some samples")]
        let skipped = -(after as isize);
        let skipped = skipped.rem_euclid(SAMPLES.cast_signed()).cast_unsigned();
        let mut all = held.clone();
        all.values.extend(&halves[1].part(skipped, HALF).values);
        let expected = expected(&all);
        (expected.last().is_some_and(|code| code == newest)).then_some(expected)
    });
    let expected = expected.expect("the code of the samples at its time");
    check_fillers(published, HALF / SAMPLES, lost, &expected);
}

/// Checks that a code is a filler exactly if a missing frame affects its window, and that all other
/// codes equal those in `expected`. Missing are `lost` frames, the first of which has the index
/// `first`.
fn check_fillers(published: &Published, first: usize, lost: usize, expected: &[Vec<f32>]) {
    assert_eq!(published.frames.len(), expected.len(), "{}", published.log);
    // The first step after a gap is computed from all samples since the step before, including
    // missing ones, so one more window is affected.
    let missing = first + 1 - HOPS..first + lost + 1;
    for (window, (frame, code)) in published.frames.iter().zip(expected).enumerate() {
        assert_eq!(is_filler(frame), missing.contains(&window), "window {window}");
        if !is_filler(frame) {
            assert_eq!(&frame.eeg.data, code, "window {window}");
        }
    }
}

#[test]
fn what_a_stream_needs_to_be_encoded_is_what_the_refusal_says() {
    let test = "streams of the Lab Streaming Layer with one name";
    let Some(interpreter) = wheels::python(test) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let ros = Ros::start_master_of(&programs().bridge, folder).expect("the master starts");
    let name = unique("twin");
    let mut eeg = Eeg::synthetic();
    eeg.values = eeg.values.repeat(5);
    let _players = ["left", "right"].map(|side| {
        let folder = folder.join(side);
        fs::create_dir(&folder).expect("a folder");
        play(&interpreter, &folder, &name, &eeg, &[&format!("source={name} {side}")])
    });
    let library = format!("--liblsl={}", liblsl(&interpreter).display());
    let until = |source: &str, more: &[&str], text: &str| {
        let options = [&["--source", source, &library], more].concat();
        let mut node = start_node(&ros, folder, &options);
        node.wait_until(text, TIMEOUT, |node| node.errors().contains(text));
        let log = node.errors();
        assert!(node.stop(Signal::TERM, EXIT_TIMEOUT).success());
        log
    };
    let log = until(&format!("lsl:{name}"), &[], "2 streams match; choose one: ");
    let typed = log.split("--source '").skip(1).filter_map(|rest| rest.split('\'').next());
    let mut typed: Vec<&str> = typed.collect();
    typed.sort_unstable();
    let expected = ["left", "right"].map(|side| format!("lsl:source_id={name} {side}"));
    assert_eq!(typed, expected, "{log}");
    let log = until(typed[1], &[], "has the unit \"furlongs\"; state it with --source-unit ");
    assert!(log.contains("--source-unit microvolts"), "{log}");
    let encoding = format!("encoding {}", typed[1]);
    until(typed[1], &["--source-unit", "microvolts"], &encoding);
}
