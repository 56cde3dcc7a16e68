//! Everything that a board can send, at once, with an input whose trigger bounces.

use std::fmt;
use std::fs;
use std::path::Path;

use link::{Stats, Streams, ToHost};
use model::{CELLS, CHANNELS, STEPS};
use pipeline::{Encoder, Sample, Step};
use serde::Serialize;

use super::figures::Said;
use super::frames::{self, Made};
use super::heard::Heard;
use super::input::Input;
use super::stages::Stages;
use super::triggers::{self, Triggers};
use super::{IMAGE, PATIENCE, VIRTUAL_TIME, host, input};
use crate::benchmark::emulator::{self, Image, Machine};
use crate::benchmark::{cannot_write, make_folder};
use crate::failure::Failure;

/// Samples that are taken, from the middle of the input, where a recording begins: 31 s, and so four
/// audits. A multiple of a raw frame's.
const SAMPLES: usize = 15_872;

/// Most samples that a board may be ahead of its own report: what waits for the encoder.
const AHEAD: u64 = 16;

/// What came of all streams at once.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct AllStreams {
    /// Whether all that was made of the samples is host-sim's: content, order and time.
    pub(super) equal: bool,
    /// Frames of each kind that were compared.
    codes: usize,
    raw_frames: usize,
    filtered_frames: usize,
    reports: usize,
    /// Audits, each of which the encoder has made again of its planes.
    audits: usize,
    /// Samples of the raw frames; they are the input's.
    raw_samples: usize,
    overruns: u32,
    frames_dropped: u32,
    bytes: usize,
    /// Bytes per second of the machine's time.
    bytes_per_second: usize,
    triggers: Triggers,
    pub(super) stages: Stages,
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

/// What goes into all runs, and what host-sim makes of it.
pub(super) struct Expected {
    samples: Vec<Sample>,
    sent: Vec<u8>,
}

impl Expected {
    /// From the middle of the input.
    ///
    /// # Errors
    /// As host-sim's.
    pub(super) fn of(input: &Input) -> Result<Self, Failure> {
        let all = &input.samples;
        let skip = all.len().saturating_sub(SAMPLES) / 2;
        let samples: Vec<_> = all.iter().skip(skip).take(SAMPLES).copied().collect();
        let sent = host::sent_of(Streams::ALL, &samples)?;
        Ok(Self { samples, sent })
    }
}

impl AllStreams {
    /// Runs the image with all streams.
    ///
    /// # Errors
    /// QEMU fails, or the image does not come to its end.
    pub(super) fn of(
        image: &Image,
        machine: Machine,
        folder: &Path,
        expected: &Expected,
    ) -> Result<Self, Failure> {
        let folder = folder.join("streams");
        make_folder(&folder)?;
        let edges = triggers::edges(expected.samples.len());
        let bytes = edges.iter().flat_map(|edge| edge.to_le_bytes()).collect();
        for (name, bytes) in [
            (input::FILE, input::bytes_of(&expected.samples)),
            (triggers::FILE, bytes),
        ] {
            let path = folder.join(name);
            fs::write(&path, bytes).map_err(|error| cannot_write(&path, &error))?;
        }
        let words = [IMAGE, "start-all", "trigger"];
        let mut command = image.command(machine, &folder, &words);
        command.args(["-icount", VIRTUAL_TIME, "-serial", "file:uart"]);
        let said = emulator::run_to_end(&mut command, PATIENCE, |_| ())?;
        let uart = folder.join("uart");
        let sent = fs::read(&uart).map_err(|error| cannot_write(&uart, &error))?;
        Ok(Self::new(&sent, &said, expected, &edges))
    }

    fn new(sent: &[u8], said: &[String], expected: &Expected, edges: &[u64]) -> Self {
        let boots = Heard::boots(sent);
        let heard = &boots[0];
        let made = [&expected.sent[..], sent].map(Made::all);
        let difference = frames::first_difference(&made[0], &made[1]);
        let count = |what| made[1].iter().filter(|made| made.what == what).count();
        let last = heard.stats.last().copied().unwrap_or_default();
        let said = Said::of(said);
        let audits = audits(sent);
        let raw = raw_samples(sent);
        let triggers = Triggers::new(sent, edges);
        let stages = Stages::of(heard.timing.last());
        let all = expected.samples.len();
        let seconds = all / usize::from(model::ADC_RATE_HZ);
        let overruns = said.overruns.max(last.overruns);
        let counters = different_counts(&Heard::boots(&expected.sent)[0].stats, &heard.stats);
        let checks = [
            (boots.len() == 1, format!("{} boots", boots.len())),
            (
                difference.is_none(),
                format!("not host-sim's: {}", difference.clone().unwrap_or_default()),
            ),
            (
                audits.iter().all(|sound| *sound) && !audits.is_empty(),
                format!("{audits:?}: audits whose code is not that of their planes are false"),
            ),
            (
                raw == expected.samples,
                format!("{} raw samples are not the {all} that went in", raw.len()),
            ),
            (
                said.samples == all as u64,
                format!("{} of {all} samples", said.samples),
            ),
            (overruns == 0, format!("{overruns} overruns")),
            (
                last.frames_dropped == 0 && heard.missing == 0 && heard.damaged == 0,
                format!(
                    "{} frames dropped, {} missing, {} damaged",
                    last.frames_dropped, heard.missing, heard.damaged
                ),
            ),
            (
                counters.is_none(),
                format!("its counters: {}", counters.clone().unwrap_or_default()),
            ),
        ];
        let faults = checks.into_iter().filter(|(sound, _)| !sound);
        let faults = faults.map(|(_, what)| what);
        let faults = faults.chain(stages.faults_when_busy());
        let faults = faults.chain(triggers.faults.iter().cloned());
        Self {
            equal: difference.is_none() && raw == expected.samples,
            codes: count("code"),
            raw_frames: count("raw samples"),
            filtered_frames: count("filtered steps"),
            reports: count("report"),
            audits: audits.len(),
            raw_samples: raw.len(),
            overruns,
            frames_dropped: last.frames_dropped,
            bytes: sent.len(),
            bytes_per_second: sent.len() / seconds.max(1),
            faults: faults.map(|what| format!("all streams: {what}")).collect(),
            triggers,
            stages,
        }
    }
}

/// Whether each audit's code is the one that the encoder makes of its planes, and the one that was sent
/// as that window's.
fn audits(sent: &[u8]) -> Vec<bool> {
    let mut codes = std::collections::HashMap::new();
    let mut sound = Vec::new();
    frames::each(sent, |_, message| match message {
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
            let again = code.map(|code| values(&code.values));
            sound.push(
                planes.len() == STEPS
                    && again == Some(audit.values)
                    && codes.get(&audit.window) == Some(&audit.values),
            );
        }
        _ => {}
    });
    sound
}

/// In the words of the link.
fn values(values: &pipeline::CodeValues) -> link::CodeValues {
    match *values {
        pipeline::CodeValues::Int8(values) => link::CodeValues::Int8(values),
        pipeline::CodeValues::Int8Exponent { exponent, values } => {
            link::CodeValues::Int8Exponent { exponent, values }
        }
        pipeline::CodeValues::Int16(values) => link::CodeValues::Int16(values),
    }
}

/// The samples of all raw frames that go on without a gap.
fn raw_samples(sent: &[u8]) -> Vec<Sample> {
    let mut samples = Vec::new();
    frames::each(sent, |_, message| {
        if let ToHost::Raw(raw) = message
            && raw.first_sample == samples.len() as u64
        {
            let counts: Vec<i32> = raw.counts().collect();
            let of_each = counts.as_chunks::<CHANNELS>().0;
            samples.extend(of_each.iter().map(|counts| Sample { counts: *counts }));
        }
    });
    samples
}

/// What is wrong with the counters: all are host-sim's, but for those of the acquisition, which may be
/// ahead, and those of commands.
fn different_counts(expected: &[Stats], found: &[Stats]) -> Option<String> {
    if expected.len() != found.len() {
        return Some(format!("{} of {}", found.len(), expected.len()));
    }
    let mut pairs = expected.iter().zip(found);
    let wrong = pairs.find(|(expected, found)| {
        let ahead = found.samples.wrapping_sub(expected.samples);
        let same = Stats {
            samples: expected.samples,
            clipped: expected.clipped,
            ..**found
        };
        ahead > AHEAD || found.clipped < expected.clipped || same != **expected
    });
    wrong.map(|(expected, found)| format!("{found:?}, expected {expected:?}"))
}

impl fmt::Display for AllStreams {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let worst = self.stages.worst_over_deadline().unwrap_or(f64::NAN);
        write!(
            f,
            "all streams at once: {} codes, {} raw, {} filtered, {} reports {} to host-sim's; {} audits \
             made again; {} samples as they went in; {} overruns, {} frames dropped; {} bytes/s; worst \
             stage {worst:.2} of its deadline\n  {}",
            self.codes,
            self.raw_frames,
            self.filtered_frames,
            self.reports,
            if self.equal { "equal" } else { "NOT equal" },
            self.audits,
            self.raw_samples,
            self.overruns,
            self.frames_dropped,
            self.bytes_per_second,
            self.triggers
        )
    }
}

#[cfg(test)]
mod tests {
    use link::{Encoder, MAX_FRAME};

    use super::*;

    /// The frames of what was sent, without numbers that tell of a change.
    fn changed(sent: &[u8], mut change: impl FnMut(ToHost<'_>) -> Option<Vec<u8>>) -> Vec<u8> {
        let mut changed = Vec::new();
        frames::each(sent, |header, message| {
            if let Some(frame) = change(message.clone()) {
                changed.extend(frame);
            } else {
                let mut buffer = [0; MAX_FRAME];
                let frame = link::encode(&header, message, &mut buffer);
                changed.extend(frame.expect("a frame"));
            }
        });
        changed
    }

    fn frame(header: u32, at_us: u64, message: &ToHost<'_>) -> Vec<u8> {
        let mut buffer = [0; MAX_FRAME];
        let frame = Encoder::starting_at(header).encode(at_us, message, &mut buffer);
        frame.expect("a frame").to_vec()
    }

    /// Faults of a board that sends what host-sim does, and these frames in place of its own; without
    /// those of what host-sim does not have: stages and triggers.
    fn faults(change: impl FnMut(ToHost<'_>) -> Option<Vec<u8>>) -> String {
        let input = Input::make(40).expect("an input");
        let samples = input.samples;
        let sent = host::sent_of(Streams::ALL, &samples).expect("host-sim");
        let said = [
            format!("samples {}", samples.len()),
            "overruns 0".to_owned(),
        ];
        let expected = Expected { samples, sent };
        let sent = changed(&expected.sent, change);
        let found = AllStreams::new(&sent, &said, &expected, &[]);
        let left_out = ["it has not said how", "of stack were used", "no event"];
        let faults = found.faults.into_iter();
        let faults = faults.filter(|fault| !left_out.iter().any(|words| fault.contains(words)));
        faults.collect::<Vec<_>>().join("; ")
    }

    #[test]
    fn a_raw_count_a_filtered_step_and_a_counter_that_differ_are_named() {
        assert_eq!(faults(|_| None), "");
        let wrong = faults(|message| match message {
            ToHost::Raw(mut raw) if raw.first_sample == 64 => {
                let mut counts = raw.counts.to_vec();
                counts[100] ^= 1;
                raw.counts = &counts;
                Some(frame(0, 140_625, &ToHost::Raw(raw)))
            }
            _ => None,
        });
        assert!(wrong.contains("raw samples, has other content"), "{wrong}");
        assert!(wrong.contains("raw samples are not the"), "{wrong}");
        let wrong = faults(|message| match message {
            ToHost::Stats(mut stats) => {
                stats.codes_made += 1;
                Some(frame(0, 0, &ToHost::Stats(stats)))
            }
            _ => None,
        });
        assert!(wrong.contains("its counters: "), "{wrong}");
    }

    #[test]
    fn an_audit_of_other_planes_is_named_even_where_host_sim_sends_the_same() {
        let samples = Input::make(40).expect("an input").samples;
        let sent = host::sent_of(Streams::ALL, &samples).expect("host-sim");
        assert_eq!(audits(&sent), [true]);
        let wrong = changed(&sent, |message| match message {
            ToHost::Audit(mut audit) => {
                let mut planes = audit.planes.to_vec();
                planes[7 * CELLS + 40] ^= 0x40;
                audit.planes = &planes;
                Some(frame(0, 0, &ToHost::Audit(audit)))
            }
            _ => None,
        });
        assert_eq!(audits(&wrong), [false]);
    }
}
