//! A scenario as it is written in its file.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use bridge_core::{AnnouncedStream, Choice, RawForm, StreamKind};
use link::Streams;
use serde::{Deserialize, Deserializer, de::Error as _};
use thiserror::Error;
use toml::Spanned;

use crate::fault::Fault as ConverterFault;
use crate::trigger::Trigger;

/// A session to rehearse, read from a TOML file; `docs/scenarios.md` lists its keys.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    pub(super) name: String,
    /// Seed of the line's random faults.
    #[serde(default)]
    pub(super) seed: u64,
    #[serde(deserialize_with = "positive")]
    pub(super) duration_s: f64,
    #[serde(default = "codes", deserialize_with = "streams")]
    pub(super) streams: Streams,
    #[serde(default, deserialize_with = "choice")]
    pub(super) announced: Option<AnnouncedStream>,
    /// Interval between trigger edges, seconds of the board's clock.
    #[serde(default, deserialize_with = "trigger")]
    pub(super) trigger_every_s: Option<Trigger>,
    /// Faults of converters and electrodes, in the syntax of `host-sim run --fault`.
    #[serde(default, deserialize_with = "converter_faults")]
    pub(super) converters: Vec<ConverterFault>,
    #[serde(default)]
    pub(super) source: SourceTable,
    #[serde(default)]
    pub(super) clock: ClockTable,
    #[serde(default)]
    pub(super) line: LineTable,
    #[serde(default)]
    pub(super) noise: Noise,
    #[serde(default)]
    pub(super) host: HostTable,
    #[serde(default, rename = "fault")]
    pub(super) faults: Vec<Spanned<ScheduledFault>>,
    #[serde(default)]
    pub(super) limits: Limits,
}

/// Signal at the electrodes.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SourceTable {
    /// Recording to play, relative to the scenario's file; `None` for synthetic EEG.
    pub(super) recording: Option<PathBuf>,
    pub(super) seed: u64,
    /// Whether single electrodes are driven to the ADC's rail.
    pub(super) rails: bool,
}

impl Default for SourceTable {
    fn default() -> Self {
        Self { recording: None, seed: 1, rails: false }
    }
}

/// Rates of the board's oscillators.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ClockTable {
    /// Host seconds per second of the board's clock, minus 1, ppm.
    #[serde(deserialize_with = "ppm")]
    pub(super) ppm: f64,
    /// Seconds of the board's clock per second of the converters' clock, minus 1, ppm.
    #[serde(deserialize_with = "ppm")]
    pub(super) converter_ppm: f64,
    /// Changes of `ppm` during the session.
    pub(super) changes: Vec<ClockChange>,
}

/// A change of the clock's rate by `ppm`. The rate changes gradually for `for_s` seconds, from
/// `at_s` on, and then stays constant.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClockChange {
    #[serde(deserialize_with = "positive")]
    pub(super) at_s: f64,
    #[serde(default, deserialize_with = "not_negative")]
    pub(super) for_s: f64,
    #[serde(deserialize_with = "ppm")]
    pub(super) ppm: f64,
}

/// Kind of port, which decides what happens when it is interrupted or the host reads too slowly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum LineKind {
    /// The board's own USB: waits for the host; a restart of the board interrupts it.
    #[default]
    Usb,
    /// A UART behind an adapter: loses frames that do not fit the host's buffer; a restart of the
    /// board does not interrupt it.
    Uart,
    /// A network connection: waits for the host, and loses nothing while the network is down.
    Tcp,
}

/// The line between board and host.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct LineTable {
    pub(super) kind: LineKind,
    /// Capacity, bytes per second; by default 92,160 for a UART (921,600 baud), else 600,000.
    #[serde(deserialize_with = "some_positive")]
    pub(super) bytes_per_s: Option<f64>,
    /// Shortest time from the end of a frame on the line to its arrival at the host, and the
    /// largest random addition to this time, milliseconds. Most additions are less than a quarter
    /// of the largest.
    #[serde(deserialize_with = "not_negative")]
    pub(super) delay_ms: f64,
    #[serde(deserialize_with = "not_negative")]
    pub(super) jitter_ms: f64,
}

impl Default for LineTable {
    fn default() -> Self {
        Self { kind: LineKind::Usb, bytes_per_s: None, delay_ms: 0.2, jitter_ms: 2.0 }
    }
}

impl LineTable {
    /// Returns the capacity of the line, bytes per microsecond.
    pub(super) fn bytes_per_us(&self) -> f64 {
        let of_kind = match self.kind {
            // 10 bits for each byte: start bit, eight bits, stop bit.
            LineKind::Uart => 92_160.0,
            // Half of what bulk transfers at full speed can carry, because other devices share the
            // bus.
            LineKind::Usb | LineKind::Tcp => 600_000.0,
        };
        self.bytes_per_s.unwrap_or(of_kind) / 1e6
    }
}

/// Probabilities of the line's random faults per bit, frame or chunk, in both directions.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Noise {
    #[serde(deserialize_with = "rate")]
    pub(super) bit_errors: f64,
    #[serde(deserialize_with = "rate")]
    pub(super) frames_dropped: f64,
    #[serde(deserialize_with = "rate")]
    pub(super) frames_duplicated: f64,
    /// Probabilities per chunk. A chunk has up to 64 bytes, the size of a USB packet at full speed.
    #[serde(deserialize_with = "rate")]
    pub(super) chunks_dropped: f64,
    #[serde(deserialize_with = "rate")]
    pub(super) chunks_duplicated: f64,
    /// Mean number of consecutive frames that are dropped at once.
    #[serde(deserialize_with = "positive")]
    pub(super) burst: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            bit_errors: 0.0,
            frames_dropped: 0.0,
            frames_duplicated: 0.0,
            chunks_dropped: 0.0,
            chunks_duplicated: 0.0,
            burst: 1.0,
        }
    }
}

impl Noise {
    /// Returns the name and the probability of each kind of random fault.
    pub(super) fn rates(&self) -> [(&'static str, f64); 5] {
        [
            ("bit_errors", self.bit_errors),
            ("frames_dropped", self.frames_dropped),
            ("frames_duplicated", self.frames_duplicated),
            ("chunks_dropped", self.chunks_dropped),
            ("chunks_duplicated", self.chunks_duplicated),
        ]
    }
}

/// How the host reads the port.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct HostTable {
    /// Interval at which the host reads, milliseconds; with 0, it reads whenever bytes arrive.
    #[serde(deserialize_with = "not_negative")]
    pub(super) poll_ms: f64,
    /// Capacity of the receive buffer in the host's driver, bytes.
    pub(super) buffer_bytes: usize,
    /// Whether the bridge searches for the board (`--port auto`), or opens one port with a fixed
    /// name.
    pub(super) port_auto: bool,
}

impl Default for HostTable {
    fn default() -> Self {
        Self {
            poll_ms: 0.0,
            // Linux: TTYB_DEFAULT_MEM_LIMIT of drivers/tty/tty_buffer.c.
            buffer_bytes: 65_536,
            port_auto: true,
        }
    }
}

/// Kind of a scheduled fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum FaultKind {
    /// The cable is unplugged; the board keeps its power.
    Unplug,
    /// The host does not run, as when it is suspended.
    Stall,
    /// The board restarts between two frames.
    Restart,
    /// The board loses its power in the middle of a frame.
    BrownOut,
    /// Acknowledgements of the board are lost on the line.
    LostAcks,
    /// Another program sends commands to the board.
    Commands,
    /// The host's wall clock jumps by `step_s`.
    WallClock,
}

/// A fault, and the times at which it occurs.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScheduledFault {
    pub(super) kind: FaultKind,
    #[serde(deserialize_with = "not_negative")]
    pub(super) at_s: f64,
    #[serde(default, deserialize_with = "not_negative")]
    pub(super) for_s: f64,
    /// Interval at which the fault is repeated, seconds.
    #[serde(default, deserialize_with = "some_positive")]
    pub(super) every_s: Option<f64>,
    /// `unplug`: the port has another name afterwards.
    #[serde(default)]
    pub(super) renumbered: bool,
    /// `commands`: number of commands per second.
    #[serde(default, deserialize_with = "some_positive")]
    pub(super) per_s: Option<f64>,
    /// `wall-clock`: step of the wall clock, seconds.
    #[serde(default)]
    pub(super) step_s: Option<f64>,
}

/// Largest values with which a scenario passes. A limit that the file omits has a strict default.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Limits {
    /// Limits for the errors of time stamps and of events, milliseconds. The line's shortest delay
    /// is subtracted from each error.
    #[serde(deserialize_with = "not_negative")]
    pub(super) stamp_p99_ms: f64,
    #[serde(deserialize_with = "not_negative")]
    pub(super) stamp_max_ms: f64,
    #[serde(deserialize_with = "not_negative")]
    pub(super) event_max_ms: f64,
    /// Time after a start, a restart and a step of the wall clock in which only `unsettled_max_ms`
    /// limits the errors, seconds.
    #[serde(deserialize_with = "not_negative")]
    pub(super) settle_s: f64,
    #[serde(deserialize_with = "not_negative")]
    pub(super) unsettled_max_ms: f64,
    /// Limit for the magnitude of the running sum of all interruptions' errors, milliseconds. The
    /// error of an interruption is the time that its fillers represent, minus its duration.
    #[serde(deserialize_with = "not_negative")]
    pub(super) gap_error_ms: f64,
    /// Largest allowed fraction of fillers among all rows of a topic. A filler replaces a missing
    /// row.
    #[serde(deserialize_with = "not_negative")]
    pub(super) fillers: f64,
    pub(super) lost_events: u64,
    /// Longest allowed time from the end of a fault to the next row that is not a filler, seconds.
    #[serde(deserialize_with = "not_negative")]
    pub(super) recovery_s: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            stamp_p99_ms: 0.5,
            stamp_max_ms: 1.0,
            event_max_ms: 1.0,
            settle_s: 60.0,
            unsettled_max_ms: 2.0,
            gap_error_ms: 62.5,
            fillers: 0.0,
            lost_events: 0,
            recovery_s: 1.0,
        }
    }
}

/// Why a file is not a scenario.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{0} cannot be read; check the name")]
    Read(PathBuf, #[source] std::io::Error),
    /// The file is not TOML, or a key or value is not valid in a scenario.
    #[error("{0} is no scenario; docs/scenarios.md lists the keys")]
    Toml(PathBuf, #[source] Box<toml::de::Error>),
    /// Keys contradict each other.
    #[error("{path}:{line}: {what}")]
    Contradiction {
        /// The file.
        path: PathBuf,
        /// Line number in the scenario file; the first line is 1.
        line: usize,
        /// The contradiction, and how to remove it.
        what: String,
    },
}

impl Scenario {
    /// Reads the scenario in the file at `path`.
    ///
    /// # Errors
    /// [`ScenarioError`] if the file cannot be read or is not a scenario.
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        let text = std::fs::read_to_string(path);
        let text = text.map_err(|error| ScenarioError::Read(path.to_owned(), error))?;
        let scenario: Result<Self, _> = toml::from_str(&text);
        let mut scenario =
            scenario.map_err(|error| ScenarioError::Toml(path.to_owned(), Box::new(error)))?;
        if let Err((at, what)) = scenario.check() {
            return Err(ScenarioError::Contradiction {
                path: path.to_owned(),
                line: text[..at.min(text.len())].lines().count().max(1),
                what,
            });
        }
        if let Some(recording) = &mut scenario.source.recording {
            let folder = path.parent().unwrap_or(Path::new(""));
            *recording = folder.join(&*recording);
        }
        Ok(scenario)
    }

    /// Returns the name of the scenario, which its report shows.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the duration of the scenario, seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the stream that the bridge announces; by default the first in topic order that runs.
    pub(super) fn announced(&self) -> AnnouncedStream {
        let mut topics = AnnouncedStream::TOPICS.iter().map(|(_, stream)| *stream);
        let first = topics.find(|stream| stream.is_in(self.streams));
        self.announced.or(first).unwrap_or_default()
    }

    /// Returns an error and its offset in the file if keys contradict each other, for example if a
    /// fault would begin after the end of the scenario.
    fn check(&self) -> Result<(), (usize, String)> {
        let end = self.duration_s;
        for fault in &self.faults {
            let at = fault.span().start + 1;
            let fault = fault.get_ref();
            let last = fault.at_s + fault.for_s;
            if last + 1.0 > end {
                let what = format!(
                    "this fault ends at {last} s, less than 1 s before the end at {end} s, so it would not be \
                     rehearsed; move it, or raise duration_s"
                );
                return Err((at, what));
            }
            let need = |has: bool, key: &str, kinds: &[FaultKind]| {
                let wants = kinds.contains(&fault.kind);
                let verb = if wants { "needs" } else { "has no" };
                let say = || format!("a fault of kind {:?} {verb} {key}", fault.kind);
                (has == wants).then_some(()).ok_or_else(|| (at, say()))
            };
            need(fault.per_s.is_some(), "per_s", &[FaultKind::Commands])?;
            need(fault.step_s.is_some(), "step_s", &[FaultKind::WallClock])?;
            let instant = [FaultKind::WallClock];
            need(fault.for_s == 0.0, "for_s of 0", &instant)?;
            if fault.renumbered && fault.kind != FaultKind::Unplug {
                return Err((at, "only a port that is unplugged is renumbered".to_owned()));
            }
            if fault.kind == FaultKind::Stall && fault.for_s == 0.0 || fault.step_s == Some(0.0) {
                let what = "this fault has no effect; raise for_s or step_s above 0";
                return Err((at, what.to_owned()));
            }
            if fault.every_s.is_some_and(|every| end / every > 1e6) {
                let what = "this fault repeats more than a million times; raise every_s";
                return Err((at, what.to_owned()));
            }
            if fault.every_s.is_some_and(|every| every <= fault.for_s) {
                let what = "this fault repeats before it has ended; raise every_s above for_s";
                return Err((at, what.to_owned()));
            }
        }
        let late = |at_s: f64| at_s >= end;
        if self.clock.changes.iter().any(|change| late(change.at_s)) {
            let what = format!("a change of the clock begins after the end at {end} s");
            return Err((0, what));
        }
        if self.converters.iter().any(|fault| late(fault.start_s())) {
            let what = format!("a fault of the converters begins after the end at {end} s");
            return Err((0, what));
        }
        let is_uart = self.line.kind == LineKind::Uart && self.line.bytes_per_s.is_none();
        if is_uart && self.streams.contains(Streams::RAW) {
            let what = "a board refuses plain samples over a UART, which is too slow for them; write \
                        compressed-raw in streams";
            return Err((0, what.to_owned()));
        }
        if !self.announced().is_in(self.streams) {
            let what = "the announced stream is not among the streams; add it to streams";
            return Err((0, what.to_owned()));
        }
        Ok(())
    }
}

fn codes() -> Streams {
    Streams::CODES
}

/// Reads a number for which `is_valid` holds. The error message ends with "write" and `what`.
fn number<'de, D: Deserializer<'de>>(
    from: D,
    is_valid: impl Fn(f64) -> bool,
    what: &str,
) -> Result<f64, D::Error> {
    let number = f64::deserialize(from)?;
    let valid = Some(number).filter(|number| number.is_finite() && is_valid(*number));
    valid.ok_or_else(|| D::Error::custom(format!("{number} is out of range; write {what}")))
}

fn positive<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    number(from, |number| number > 0.0, "a number above 0")
}

fn ppm<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let is_clock = |ppm: f64| ppm.abs() <= 100_000.0;
    number(from, is_clock, "a number from -100000 to 100000")
}

fn some_positive<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    positive(from).map(Some)
}

fn not_negative<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    number(from, |number| number >= 0.0, "0 or a number above it")
}

fn rate<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    number(from, |rate| (0.0..1.0).contains(&rate), "a rate from 0 to below 1")
}

fn trigger<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Trigger>, D::Error> {
    let interval = std::time::Duration::try_from_secs_f64(positive(from)?);
    let interval = interval.map_err(D::Error::custom)?;
    Trigger::every(interval).map(Some).map_err(D::Error::custom)
}

fn choice<'de, D: Deserializer<'de>, T: Choice>(from: D) -> Result<Option<T>, D::Error> {
    named::<T>(&String::deserialize(from)?).map(Some).map_err(D::Error::custom)
}

/// Returns the choice with this name, or an error that lists all names.
fn named<T: Choice>(name: &str) -> Result<T, String> {
    let found = T::CHOICES.iter().find(|(choice, ..)| *choice == name);
    let names: Vec<&str> = T::CHOICES.iter().map(|(name, ..)| *name).collect();
    let none = || format!("'{name}' is none of {}", names.join(", "));
    found.map(|(.., value)| *value).ok_or_else(none)
}

fn streams<'de, D: Deserializer<'de>>(from: D) -> Result<Streams, D::Error> {
    let names: Vec<String> = Vec::deserialize(from)?;
    names.iter().try_fold(Streams::empty(), |all, name| {
        Ok(all
            | if name == "compressed-raw" {
                RawForm::Compressed.streams()
            } else {
                named::<StreamKind>(name).map_err(D::Error::custom)?.bit()
            })
    })
}

fn converter_faults<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<ConverterFault>, D::Error> {
    let texts: Vec<String> = Vec::deserialize(from)?;
    texts.iter().map(|text| parsed(text)).collect()
}

fn parsed<T: FromStr<Err: Display>, E: serde::de::Error>(text: &str) -> Result<T, E> {
    text.parse().map_err(E::custom)
}
