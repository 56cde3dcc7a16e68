//! The command `host-sim run`, which runs the virtual board.

use std::{
    error::Error,
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::{SystemTime, UNIX_EPOCH},
};

use host_sim::{
    Faults, FileRules, Identity, Pace, RecordedEdges, Report, Session, Source,
    synthetic::{Generator, SyntheticSpec},
};
use link::{Streams, Substitutes};
use new_file::Existing;
use offline::Played;
use pipeline::Mains;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::batch::progress_bar;
use crate::command_line::{Input, RunOptions};

pub(crate) fn run(options: &RunOptions) -> Result<(), Box<dyn Error>> {
    if !options.streams.is_empty() && options.output.file().is_none() {
        return Err(
            "--streams is for file: and ndjson:; of a port, the host selects the streams".into()
        );
    }
    if options.streams.contains(&Streams::CODES) && !model::HAS_NETWORK {
        return Err("the built-in model has no network; write --streams packed".into());
    }
    if options.streams.contains(&Streams::PACKED) && model::PACKED.is_none() {
        return Err("the built-in model has no packed code; write --streams codes".into());
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, stop.clone())?;
    }
    let OpenedInput { mut source, substitutes, recorded_edges } = OpenedInput::new(options)?;
    let faults = Faults::new(&options.fault)?;
    let session = session(options, faults, substitutes, recorded_edges);
    let total = match (source.samples(), session.limit) {
        (Some(samples), Some(limit)) => Some(samples.min(limit)),
        (samples, limit) => samples.or(limit),
    };
    if !options.quiet {
        let model = u64::from_be_bytes(model::MODEL_ID);
        new_file::message!("virtual board with model {model:016x} on {}", session.output);
    }
    let seconds = total.map(|samples| samples / rate());
    let progress = progress_bar(seconds, "s  {msg}", options.quiet);
    let report = session.run(&mut source, &stop, |stats, blocks| {
        progress.inc(1);
        let hops = hops(stats.codes_made, blocks, "");
        progress.set_message(format!("{hops}, {} frames dropped", stats.frames_dropped));
    })?;
    progress.finish_and_clear();
    for warning in warnings(&report, &source) {
        new_file::message!("warning: {warning}");
    }
    if !options.quiet {
        new_file::message!("{}", summary(&report));
    }
    Ok(())
}

/// Formats the numbers of codes and of packed blocks, each followed by `made`. Omits a number that
/// is 0 because no host asked for the stream.
fn hops(codes: u32, blocks: u64, made: &str) -> String {
    match (codes, blocks) {
        (0, 1..) => format!("{blocks} packed blocks{made}"),
        (_, 0) => format!("{codes} codes{made}"),
        _ => format!("{codes} codes{made}, {blocks} packed blocks{made}"),
    }
}

fn rate() -> u64 {
    model::ADC_RATE_HZ.into()
}

fn session(
    options: &RunOptions,
    faults: Faults,
    substitutes: Substitutes,
    recorded_edges: RecordedEdges,
) -> Session {
    let is_fast = options.output.file().is_some() && !options.realtime;
    let pace = if options.fast || is_fast { Pace::Fast } else { Pace::Realtime };
    let default_id = || match pace {
        // In virtual time the session id is constant, because equal runs must write equal bytes.
        Pace::Fast => 1,
        Pace::Realtime => SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(1, |now| now.subsec_nanos() ^ std::process::id().rotate_left(16)),
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the duration is positive; beyond 2^64 samples it saturates"
    )]
    let limit = options.duration.map(|s| (s * f64::from(model::ADC_RATE_HZ)).round() as u64);
    let inputs = match &options.input {
        Input::Synthetic => Vec::new(),
        Input::Recording(path) => vec![path.clone()],
    };
    Session {
        output: options.output.clone(),
        file_rules: FileRules { existing: Existing::from_force(options.force), inputs },
        streams: streams(&options.streams),
        pace,
        clock_ppm: options.clock_ppm,
        mains: options.mains,
        identity: Identity {
            session_id: options.session_id.unwrap_or_else(default_id),
            chip_uid: *b"\0host-sim\0\0\0",
            substitutes,
        },
        limit,
        faults,
        contacts: options.impedance.clone(),
        trigger: options.trigger_every,
        recorded_edges,
    }
}

fn streams(selected: &[Streams]) -> Streams {
    if selected.is_empty() {
        return if model::HAS_NETWORK { Streams::CODES } else { Streams::PACKED };
    }
    selected.iter().fold(Streams::empty(), |all, stream| all | *stream)
}

fn summary(report: &Report) -> String {
    let stats = &report.stats;
    if stats.samples == 0 {
        return "no host started the stream".to_owned();
    }
    format!(
        "{:.1} s of signal in {:.2} s ({:.1} times real time): {}, {} frames dropped, \
         {} values clipped, {} in codes ({})",
        report.signal_s(),
        report.elapsed.as_secs_f64(),
        report.signal_s() / report.elapsed.as_secs_f64(),
        hops(stats.codes_made, report.packed_blocks, " made"),
        stats.frames_dropped,
        stats.clipped,
        stats.clipped_values,
        device::CODE_FORMAT
    )
}

/// Returns a sentence for each way in which data of the run was lost or is wrong.
fn warnings(report: &Report, source: &Source) -> Vec<String> {
    let (stats, converters) = (&report.stats, &report.converters);
    let mut warnings = match source {
        Source::Recording(adc) => adc.counters().warnings(),
        Source::Synthetic(_) => Vec::new(),
    };
    warnings.extend(report.failure.map(|failure| format!("at power-on: {failure}")));
    for (chip, errors) in converters.errors.iter().enumerate() {
        warnings
            .extend((*errors > 0).then(|| format!("converter {chip} is bad in {errors} samples")));
    }
    let losses: [(u64, _); 3] = [
        (converters.missed.into(), "samples were missed"),
        (stats.frames_dropped.into(), "frames were dropped: the host read too slowly"),
        (report.unread_bytes, "bytes were never read by the host"),
    ];
    let losses = losses.into_iter().filter(|(count, _)| *count > 0);
    warnings.extend(losses.map(|(count, what)| format!("{count} {what}")));
    warnings
}

/// Signal to play, and what was found in its recording.
struct OpenedInput {
    source: Source,
    /// Electrodes that the recording lacks, and whether they are interpolated or zero.
    substitutes: Substitutes,
    /// Trigger edges at the events of the recording.
    recorded_edges: RecordedEdges,
}

impl OpenedInput {
    /// Opens the input that the options name, and prints warnings about its defects. Also prints
    /// how a recording fits the montage, unless the options forbid it.
    fn new(options: &RunOptions) -> Result<Self, Box<dyn Error>> {
        match &options.input {
            Input::Synthetic => {
                let mut spec = SyntheticSpec::new(options.seed, model::LABELS.split(' '));
                spec.mains_hz = match options.mains {
                    Mains::Hz50 => 50,
                    Mains::Hz60 => 60,
                };
                spec.rate_hz = model::ADC_RATE_HZ.into();
                spec.rails = options.rails;
                Ok(Self {
                    source: Source::Synthetic(Box::new(Generator::new(&spec)?)),
                    substitutes: Substitutes::NONE,
                    recorded_edges: RecordedEdges::default(),
                })
            }
            Input::Recording(path) => Self::recording(path, options),
        }
    }

    fn recording(path: &Path, options: &RunOptions) -> Result<Self, Box<dyn Error>> {
        let played = Played::open(path, options.missing)?;
        if !options.quiet {
            new_file::message!("{}", played.montage);
        }
        let recorded_edges = if options.trigger_every.is_none() {
            edges(&played, options.quiet)
        } else {
            RecordedEdges::default()
        };
        for warning in &played.warnings {
            new_file::message!("warning: {warning}");
        }
        Ok(Self {
            source: Source::Recording(Box::new(played.adc)),
            substitutes: played.substitutes,
            recorded_edges,
        })
    }
}

/// Returns trigger edges that mark the events of a recording. Warns of events outside the signal,
/// and of events that share a pulse.
fn edges(played: &Played, quiet: bool) -> RecordedEdges {
    let onsets = &played.onsets;
    let edges = RecordedEdges::new(onsets, played.adc.samples());
    let shared = onsets.seconds.len() - edges.pulses();
    if shared > 0 {
        new_file::message!(
            "warning: {shared} events are less than 2 ms after another one and share its pulse"
        );
    }
    if onsets.outside > 0 {
        new_file::message!(
            "warning: {} events are outside the signal and are not played",
            onsets.outside
        );
    }
    if !quiet && edges.pulses() > 0 {
        new_file::message!(
            "events: {} trigger pulses for {} events; host-sim inspect lists them",
            edges.pulses(),
            onsets.seconds.len()
        );
    }
    edges
}
