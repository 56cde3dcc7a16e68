//! The stream of an amplifier, received as NeuroFrames.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use bridge_core::HostTime;
use neuro_ros::{NeuroDataInfo, NeuroFrame};

use crate::clock_map::ClockMap;
use crate::frame_cutter::{CutFrame, FrameCutter};
use crate::inlet_error::{Identity, InletError, choices};
use crate::liblsl::{CallError, Info, Inlet};
use crate::library::Library;

/// Number of frames per second into which samples are cut.
const FRAMES_PER_SECOND: u16 = 16;
/// Duration of one search for the stream, and time limit for the stream's answer, seconds.
const SEARCH_S: f64 = 2.0;
const ANSWER_S: f64 = 10.0;
/// Longest wait for a sample, seconds. After this time the caller is asked whether to continue.
const PULL_S: f64 = 0.1;
/// Largest number of samples fetched from liblsl at once.
const MOST_SAMPLES: usize = 4096;
/// Time between two queries of the offset between the sender's clock and this machine's.
const CORRECTION_PERIOD: Duration = Duration::from_secs(2);
/// Age of a sample, microseconds, above which its time cannot be from LSL's clock.
const MOST_AGE_US: i64 = 600_000_000;

/// Units that a stream may state, in lower case, with the number of microvolts in each.
const UNITS: &[(&str, f32)] = &[
    ("microvolts", 1.0),
    ("microvolt", 1.0),
    ("uv", 1.0),
    ("µv", 1.0),
    ("μv", 1.0),
    ("millivolts", 1e3),
    ("millivolt", 1e3),
    ("mv", 1e3),
    ("volts", 1e6),
    ("volt", 1e6),
    ("v", 1e6),
];

/// Which stream to receive, and values that override its metadata.
#[derive(Clone, Debug, Default)]
pub struct InletOptions {
    /// Property to search for (`name`, `type`, `source_id` or `hostname`), and its value.
    pub query: [String; 2],
    /// Labels of all channels; empty for the labels in the metadata.
    pub labels: Vec<String>,
    /// Unit of all channels; `None` for the unit in the metadata.
    pub unit: Option<String>,
    /// Rate of the samples, Hz; if `None`, the nominal rate counts.
    pub rate_hz: Option<u16>,
}

impl InletOptions {
    /// Parses `NAME`, or `PROPERTY=VALUE`.
    ///
    /// # Errors
    ///
    /// What is wrong and how to correct it, worded for the user.
    pub fn parse_query(text: &str) -> Result<[String; 2], String> {
        let (property, value) = text.split_once('=').unwrap_or(("name", text));
        if !["name", "type", "source_id", "hostname"].contains(&property) {
            return Err(format!(
                "lsl:{text}: streams are found by name, type, source_id or hostname, such as lsl:type=EEG"
            ));
        }
        if value.is_empty() || value.contains('\'') {
            return Err(format!("lsl:{text} names no stream, such as lsl:NAME"));
        }
        Ok([property, value].map(str::to_owned))
    }
}

/// What the inlet passes on.
#[derive(Clone, Debug, PartialEq)]
pub enum Received {
    /// Samples, and the host time at which the last sample's period ended.
    Frame(Box<NeuroFrame>, HostTime),
    /// Number of matching streams. Passed on repeatedly while no samples arrive, so that the caller
    /// can end the reception.
    Matching(usize),
    /// The stream cannot be used at present.
    Refused(InletError),
}

/// Receives the stream that the options describe, and passes frames on until `pass` returns false.
/// Waits while the stream is absent or has ended. Blocks; call it in a thread of its own.
pub fn receive(library: Library, options: &InletOptions, mut pass: impl FnMut(Received) -> bool) {
    let mut reported = None;
    loop {
        let received = receive_one(library, options, &mut pass);
        match received {
            Ok(goes_on) => {
                reported = None;
                if !goes_on {
                    return;
                }
            }
            Err(error) => {
                if reported.as_ref() != Some(&error) {
                    reported = Some(error.clone());
                    if !pass(Received::Refused(error)) {
                        return;
                    }
                }
                // Do not retry at once: the search would find the same stream again.
                std::thread::sleep(Duration::from_secs(1));
            }
        }
    }
}

/// Searches for the stream once and receives it until it ends. Returns whether the caller should
/// search again.
fn receive_one(
    library: Library,
    options: &InletOptions,
    pass: &mut impl FnMut(Received) -> bool,
) -> Result<bool, InletError> {
    let [property, value] = &options.query;
    let query = format!("{property}='{value}'");
    let found = library.functions.resolve(&query, SEARCH_S)?;
    if !pass(Received::Matching(found.len())) {
        return Ok(false);
    }
    let info = match &*found {
        [] => return Ok(true),
        [info] => info,
        several => {
            let found = several.iter().map(|info| Identity {
                name: info.name(),
                source_id: info.source_id(),
                host: info.host(),
            });
            return Err(InletError::Several(choices(&found.collect::<Vec<_>>())));
        }
    };
    let inlet = Inlet::new(info)?;
    let silent = |error: CallError| match error {
        CallError::Timeout => InletError::Silent(info.name()),
        other => other.into(),
    };
    let channels = Channels::read(&inlet.info(ANSWER_S).map_err(silent)?, options)?;
    match stream(library, &inlet, &channels, pass) {
        Err(CallError::Lost) => Ok(true),
        ended => ended.map_err(silent),
    }
}

fn stream(
    library: Library,
    inlet: &Inlet,
    channels: &Channels,
    pass: &mut impl FnMut(Received) -> bool,
) -> Result<bool, CallError> {
    let mut correction_s = inlet.time_correction(ANSWER_S)?;
    let mut corrected = Instant::now();
    let mut clock = ClockMap::default();
    let mut values = vec![0.0; MOST_SAMPLES * channels.all];
    let mut times = vec![0.0; MOST_SAMPLES];
    let samples = (channels.rate_hz / FRAMES_PER_SECOND).max(1);
    let period_us = 1e6 / f64::from(channels.rate_hz);
    let mut cutter = FrameCutter::new(channels.rate_hz, samples);
    let mut has_foreign_clock = false;
    loop {
        // Wait for one sample, then take those that have come with it. With room for more samples
        // in the first call, liblsl would wait until the room is full.
        let mut count = inlet.pull(&mut values[..channels.all], &mut times[..1], PULL_S)?;
        if count > 0 {
            count += inlet.pull(&mut values[channels.all..], &mut times[1..], 0.0)?;
        }
        clock.read(|| library.functions.local_clock());
        let now = HostTime::now();
        if corrected.elapsed() > CORRECTION_PERIOD {
            corrected = Instant::now();
            // The call does not wait, because liblsl measures in the background. If it has no
            // result, keep the old correction.
            if let Ok(newest) = inlet.time_correction(0.0) {
                correction_s = newest;
            }
        }
        let rows = values.chunks_exact(channels.all).zip(&times);
        for (row, time_s) in rows.take(count) {
            let Some(frame) = cutter.push(time_s + correction_s, channels.microvolts(row)) else {
                continue;
            };
            let end_us = clock.host_us(frame.end_s);
            let end = end_us.and_then(|us| host_time(us, period_us, now));
            if end.is_none() && !std::mem::replace(&mut has_foreign_clock, true) {
                tracing::warn!(
                    "the stream's times are not those of LSL's clock; codes get the time at which samples arrive, \
                     so their delay is not known"
                );
            }
            let received =
                Received::Frame(Box::new(channels.frame(&frame, samples)), end.unwrap_or(now));
            if !pass(received) {
                return Ok(false);
            }
        }
        if count == 0 && !pass(Received::Matching(1)) {
            return Ok(false);
        }
    }
}

/// Returns the host time at which a sample's period ends: `host_us` on the monotonic clock, at most
/// one period `period_us` after `now`, because no sample arrives before its period begins. Returns
/// `None` if `host_us` is more than 1 s in the future or too old, so that its stamp must be wrong.
fn host_time(host_us: f64, period_us: f64, now: HostTime) -> Option<HostTime> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "within 2^53 us (285 years)"
    )]
    let [ago_us, period_us] =
        [now.monotonic_us as f64 - host_us, period_us].map(|us| us.round() as i64);
    (-1_000_000..MOST_AGE_US).contains(&ago_us).then(|| {
        let ago_us = ago_us.max(-period_us);
        HostTime { monotonic_us: now.monotonic_us - ago_us, wall_ns: now.wall_ns - ago_us * 1000 }
    })
}

/// The channels of a stream, and which of them are passed on.
struct Channels {
    /// Number of all channels of the stream.
    all: usize,
    rate_hz: u16,
    /// Index of each channel that is passed on, and the number of microvolts in its unit.
    used: Vec<(usize, f32)>,
    info: NeuroDataInfo,
}

impl Channels {
    /// Reads the metadata of a stream. Without labels in `options`, leaves out channels whose
    /// stated type is neither EEG nor the stream's type.
    fn read(info: &Info, options: &InletOptions) -> Result<Channels, InletError> {
        let name = info.name();
        if info.is_text() {
            return Err(InletError::Text(name));
        }
        let all = usize::try_from(info.channels()).unwrap_or(0);
        let described: Vec<[String; 3]> = info
            .desc()
            .child("channels")
            .children("channel")
            .map(|channel| ["label", "unit", "type"].map(|key| channel.text(key)))
            .collect();
        let labels = &options.labels;
        if !labels.is_empty() && labels.len() != all {
            return Err(InletError::Labels(name, all, labels.len()));
        }
        let content = info.content();
        let (mut used, mut names) = (Vec::new(), Vec::new());
        let mut seen = BTreeSet::new();
        for place in 0..all {
            let [label, unit, kind] = described.get(place).cloned().unwrap_or_default();
            let is_eeg = kind.is_empty() || kind.eq_ignore_ascii_case("eeg") || kind == content;
            if !is_eeg && labels.is_empty() {
                continue;
            }
            let label = labels.get(place).cloned().unwrap_or(label);
            if label.is_empty() {
                return Err(InletError::Label(name, place + 1));
            }
            let unit = options.unit.clone().unwrap_or(unit);
            let known = UNITS.iter().find(|(known, _)| *known == unit.trim().to_lowercase());
            let Some((_, microvolts)) = known else {
                return Err(InletError::Unit(name, label, unit));
            };
            if !seen.insert(label.clone()) {
                return Err(InletError::Twice(name, label));
            }
            used.push((place, *microvolts));
            names.push(label);
        }
        if used.is_empty() {
            return Err(InletError::Nothing(name));
        }
        Ok(Channels {
            all,
            rate_hz: rate(info, options)?,
            used,
            info: NeuroDataInfo {
                unit: "uV".to_owned(),
                transducter: "electrodes".to_owned(),
                minmax: vec![f64::from(f32::MIN), f64::from(f32::MAX)],
                ..NeuroDataInfo::default().with_labels(names)
            },
        })
    }

    /// Returns a sample's values in the channels that are passed on, in microvolts.
    fn microvolts<'r>(&'r self, row: &'r [f32]) -> impl Iterator<Item = f32> + 'r {
        let used = self.used.iter();
        used.map(|(place, microvolts)| row[*place] * microvolts)
    }

    fn frame(&self, cut: &CutFrame, samples: u16) -> NeuroFrame {
        let eeg = NeuroDataInfo { nsamples: samples, ..self.info.clone() };
        let mut frame =
            NeuroFrame::zeros(self.rate_hz, "electrodes", eeg, NeuroDataInfo::default());
        frame.neuroheader.seq = cut.number;
        frame.header.seq = cut.number;
        frame.eeg.data.clone_from(&cut.values);
        frame
    }
}

/// Returns the rate in `options`, or else the nominal rate, which must be a whole number of Hz.
fn rate(info: &Info, options: &InletOptions) -> Result<u16, InletError> {
    if let Some(rate_hz) = options.rate_hz {
        return Ok(rate_hz);
    }
    let nominal = info.rate_hz();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is compared"
    )]
    let rate_hz = nominal.round() as u16;
    if rate_hz == 0 || (f64::from(rate_hz) - nominal).abs() > 1e-6 * nominal {
        let found = if nominal == 0.0 {
            "no regular rate".to_owned()
        } else {
            format!("a rate of {nominal} Hz")
        };
        return Err(InletError::Rate(info.name(), found));
    }
    Ok(rate_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_name_a_property_or_are_a_name() {
        let parse = |text| InletOptions::parse_query(text);
        assert_eq!(parse("actiCHamp-1"), Ok(["name", "actiCHamp-1"].map(str::to_owned)));
        assert_eq!(parse("type=EEG"), Ok(["type", "EEG"].map(str::to_owned)));
        for wrong in ["", "type=", "colour=red", "a'b"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_sample_is_taken_in_the_past_and_other_clocks_are_found() {
        let now = HostTime { monotonic_us: 1_000_000_000, wall_ns: 1_700_000_000_000_000_000 };
        let at = |host_us| host_time(host_us, 2_000.0, now).map(|time| time.monotonic_us);
        assert_eq!(at(999_000_000.0), Some(999_000_000));
        // The first period began 1.5 ms ago. The second would begin 0.5 ms in the future, because a
        // clock is wrong.
        assert_eq!(at(1_000_000_500.0), Some(1_000_000_500));
        assert_eq!(at(1_000_002_500.0), Some(1_000_002_000));
        assert_eq!(at(1.7e15), None);
        assert_eq!(at(1e8), None);
    }
}
