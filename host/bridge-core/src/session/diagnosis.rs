//! The report for `/diagnostics`, which is made once per second.

use artifact::ModelId;
use link::{Counters, Streams};
use neuro_ros::{DiagnosticArray, DiagnosticLevel, DiagnosticStatus, Header, KeyValue, Stamp};

use crate::diagnostics::{signal_quality_status, timing_status};
use crate::exclusion;
use crate::session::Session;
use crate::settings::{AnnouncedStream, RawForm, StreamKind};
use crate::streams::code::CodeStream;
use crate::streams::features::FeatureStream;
use crate::streams::ledger::SampleCounts;
use crate::time::HostTime;

/// Returns the warning from the device's newest report of signal quality, if it has one.
pub(crate) fn electrode_faults(session: &Session) -> Option<String> {
    let (quality, codes) = (session.quality.as_ref()?, session.codes.as_ref()?);
    let status = signal_quality_status(quality, &codes.device().labels);
    (status.level == DiagnosticLevel::Warn).then_some(status.message)
}

/// Builds the report for `/diagnostics`: the statuses of device, loss, link and clock, and the
/// statuses of packed blocks and converters once the device has sent messages about them. The
/// statuses of electrodes and deadlines are included only if new messages about them have arrived.
pub(crate) fn diagnose(session: &mut Session, wire: &Counters, now: HostTime) -> DiagnosticArray {
    let header = Header { stamp: Stamp::from_nanoseconds(now.wall_ns), ..Header::default() };
    let hardware = session.codes.as_ref().map_or_else(String::new, |codes| {
        let device = codes.device();
        format!("{} {}", device.board, device.uid)
    });
    let mut status = vec![
        device_status(session, now),
        loss_status(session),
        link_status(session, wire),
        clock_status(session, now),
    ];
    if let Some(packed) = &session.packed {
        let report = &mut session.counts.packed_reported;
        status.extend(report.status(packed, now.monotonic_us));
    }
    status.extend(prediction_status(session));
    if let Some(line) = session.link_log.next_line(now.monotonic_us) {
        tracing::warn!("{line}");
    }
    if let Some((report, codes)) = session.converters.as_mut().zip(session.codes.as_ref()) {
        let device = codes.device();
        let clock = &session.clock;
        let drift_ppm = clock.is_settled().then(|| clock.drift_ppm());
        status.push(report.status(device.adc_rate_hz, &device.labels, drift_ppm));
    }
    if let Some((report, codes)) = session.exclusion.as_ref().zip(session.codes.as_ref()) {
        status.push(exclusion::status(report, codes.device()));
    }
    if let Some((quality, codes)) = session.quality.take().zip(session.codes.as_ref()) {
        status.push(signal_quality_status(&quality, &codes.device().labels));
    }
    if let Some(report) = session.impedance.take() {
        status.push(report.status());
    }
    if let Some(report) = session.timing.take() {
        status.push(timing_status(&report));
    }
    for status in &mut status {
        status.hardware_id.clone_from(&hardware);
    }
    DiagnosticArray { header, status }
}

/// Returns the status of the predictions; `None` without a classifier, and before a device has
/// introduced itself.
fn prediction_status(session: &Session) -> Option<DiagnosticStatus> {
    session.classifier.as_ref()?;
    session.codes.as_ref()?;
    let unfit = || {
        let message = "the classifier is for another montage or step rate than the device's";
        let state = (DiagnosticLevel::Error, message.to_owned());
        DiagnosticStatus::new("predictions", state, Vec::new())
    };
    let features = session.features.as_ref();
    Some(features.map_or_else(unfit, FeatureStream::status))
}

fn device_status(session: &Session, now: HostTime) -> DiagnosticStatus {
    let usable = session.commands.accepts_codes();
    let refusal = session.commands.start_refusal();
    let (level, message) = match (&session.objection, session.introduced) {
        (_, false) => (DiagnosticLevel::Stale, "no device answers".to_owned()),
        (objection, true) if let Some(refusal) = refusal => {
            let reasons: Vec<String> = objection.iter().cloned().chain([refusal]).collect();
            (DiagnosticLevel::Error, reasons.join("; "))
        }
        (Some(objection), _) if usable => (DiagnosticLevel::Warn, objection.clone()),
        (Some(objection), _) => (DiagnosticLevel::Error, objection.clone()),
        (None, true) if let Some(percent) = session.commands.upload_percent() => {
            (DiagnosticLevel::Ok, format!("receiving its packed model: {percent} %"))
        }
        (None, true) if session.commands.is_starved(now.monotonic_us) => (
            DiagnosticLevel::Warn,
            "the device should stream and sends no codes and no packed blocks; it is asked again"
                .to_owned(),
        ),
        (None, true) if session.commands.is_streaming() => streaming_state(session),
        (None, true) => (DiagnosticLevel::Ok, "not streaming".to_owned()),
    };
    let mut values = vec![
        KeyValue::new("connections", &session.counts.connections),
        KeyValue::new("resets", &session.counts.resets),
        KeyValue::new("codes, blocks and features unused", &session.counts.hops_unused),
        KeyValue::new("other messages unused", &session.side.unused),
        KeyValue::new("audits of another model or size", &session.side.audits_unusable),
        KeyValue::new("streams asked for", &StreamKind::names(session.commands.streams())),
    ];
    if let Some(identity) = &session.identity {
        let hello = identity.as_hello();
        values.push(KeyValue::new("session", &format_args!("{:08x}", hello.session_id)));
        values.push(KeyValue::new("fault", &hello.fault));
    }
    if let Some(codes) = &session.codes {
        let device = codes.device();
        values.push(KeyValue::new("firmware", &device.firmware));
        values.push(KeyValue::new("model", &ModelId(device.model_id)));
        if let Some(unrecorded) = device.unrecorded() {
            values.push(KeyValue::new("electrodes not recorded", &unrecorded));
        }
        values.push(KeyValue::new("mains Hz", &device.mains_hz));
        if device.has_network() {
            values.push(KeyValue::new("code format", &device.code_format));
        }
        let has_frames =
            |stream: &AnnouncedStream| *stream != AnnouncedStream::Encoded || device.has_network();
        let topics = AnnouncedStream::TOPICS.into_iter();
        for (topic, stream) in topics.filter(|(_, stream)| has_frames(stream)) {
            let decoded = session.decoding.stream;
            let shift_us = device.recorder_shift_us(stream, decoded, &session.settings);
            let key = format!("recorder shift us {topic}");
            values.push(KeyValue::new(&key, &shift_us));
        }
        let foreign = codes.counts.foreign;
        values.push(KeyValue::new("codes of another model or format", &foreign));
    }
    if let Some(stats) = session.stats {
        values.extend([
            KeyValue::new("device: codes made", &stats.codes_made),
            KeyValue::new("device: frames dropped", &stats.frames_dropped),
            KeyValue::new("device: samples", &stats.samples),
            KeyValue::new("device: overruns", &stats.overruns),
            KeyValue::new("device: bad ADC status", &stats.adc_status_bad),
            KeyValue::new("device: values clipped", &stats.clipped),
            KeyValue::new("device: code values clipped", &stats.clipped_values),
            KeyValue::new("device: commands", &stats.commands),
            KeyValue::new("device: bad frames from here", &stats.input_bad),
        ]);
    }
    DiagnosticStatus::new("device", (level, message), values)
}

/// Returns level and message of the status `device` while the device streams. The level is a
/// warning if the device refuses codes, samples, filtered steps or packed blocks, but not if it
/// refuses only audits or events, which older firmware does not have.
fn streaming_state(session: &Session) -> (DiagnosticLevel, String) {
    let refused = session.commands.refused_streams();
    if refused.is_empty() {
        return (DiagnosticLevel::Ok, "streaming".to_owned());
    }
    let samples = RawForm::any_in(refused) || refused.contains(Streams::FILTERED);
    let packed = refused.contains(Streams::PACKED);
    let codes = refused.contains(Streams::CODES);
    let features = refused.contains(Streams::FEATURES);
    let level = if samples || packed || codes || features {
        DiagnosticLevel::Warn
    } else {
        DiagnosticLevel::Ok
    };
    let names = StreamKind::names(refused);
    let only_raw = refused.without(RawForm::Any.streams()).is_empty();
    let remedy = if only_raw && refused.contains(Streams::RAW) {
        "its port may be too slow; update its firmware, use its USB port, or choose filtered instead"
    } else if packed {
        "its image or its model has no packed code; flash an image that has it, or choose codes"
    } else if codes {
        "its image or its model has no network; choose packed without codes, or flash another image"
    } else {
        "update its firmware"
    };
    let message = format!("streaming; the device does not stream {names}: {remedy}");
    (level, message)
}

fn loss_status(session: &mut Session) -> DiagnosticStatus {
    let codes = session.codes.as_ref();
    let counts = codes.map(|codes| codes.counts).unwrap_or_default();
    let hops = codes.map(|codes| codes.timeline.counts().clone()).unwrap_or_default();
    let ledger = &hops.ledger;
    // The count can fall. If only an event has shown that a run began, the gap before the run is
    // already counted; a further restart subtracts this gap, because the next run counts it again.
    let since = hops.missing().saturating_sub(session.counts.missing_reported);
    session.counts.missing_reported = hops.missing();
    let mut losses = vec![(since, "codes")];
    if let Some(packed) = &session.packed {
        let report = session.counts.packed_reported;
        losses.push((report.missing_since(packed), "packed blocks"));
    }
    let mut side_values = Vec::new();
    for (stream, name) in
        [(&mut session.side.raw, "raw samples"), (&mut session.side.filtered, "filtered steps")]
    {
        if let Some(stream) = stream {
            losses.push((stream.missing_since_report(), name));
            side_values.extend(sample_values(&stream.counts, name));
        }
    }
    if session.side.raw.is_some() {
        let undecodable = &session.side.compressed.undecodable;
        side_values.push(KeyValue::new("raw samples undecodable", undecodable));
    }
    let events = &mut session.side.events;
    losses.push((events.lost_since_report(), "events"));
    let side_events = [
        KeyValue::new("events received", &events.ledger.received),
        KeyValue::new("events lost", &events.ledger.lost),
        KeyValue::new("events behind others", &events.ledger.replays),
        KeyValue::new("events of unknown kinds", &events.unknown),
    ];
    if session.commands.streams().contains(Streams::EVENTS) {
        side_values.extend(side_events);
    }
    let packed = session.packed.as_ref();
    let packed = packed.map_or(0, |packed| packed.timeline.counts().between_runs);
    let samples = [&session.side.raw, &session.side.filtered].into_iter();
    let samples = samples.flatten().map(|stream| stream.counts.between_runs);
    let between_runs = hops.between_runs + packed + samples.sum::<u64>();
    let missing = losses.iter().map(|(lost, _)| lost).sum();
    session.link_log.add_missing(missing, between_runs);
    losses.retain(|(lost, _)| *lost > 0);
    let state = if losses.is_empty() {
        (DiagnosticLevel::Ok, "nothing lost".to_owned())
    } else {
        let losses = losses.iter().map(|(lost, what)| format!("{lost} {what}"));
        let losses: Vec<String> = losses.collect();
        let message = format!("{} missing since the last report", losses.join(", "));
        (DiagnosticLevel::Warn, message)
    };
    let mut values = vec![
        KeyValue::new("made", &ledger.made()),
        KeyValue::new("received", &ledger.received),
        KeyValue::new("lost", &ledger.lost),
        KeyValue::new("missing between runs", &hops.between_runs),
        KeyValue::new("bursts", &ledger.bursts),
        KeyValue::new("longest burst", &ledger.longest_burst),
        KeyValue::new("fillers", &hops.fillers),
        KeyValue::new("lost and not filled", &hops.unfilled),
        KeyValue::new("values clipped", &counts.clipped),
        KeyValue::new("code values clipped", &counts.clipped_values),
    ];
    values.extend(side_values);
    DiagnosticStatus::new("loss", state, values)
}

fn sample_values(counts: &SampleCounts, name: &str) -> [KeyValue; 5] {
    let SampleCounts { received, lost, between_runs, unpublished, malformed, reported: _ } = counts;
    [
        ("received", received),
        ("lost", lost),
        ("missing between runs", between_runs),
        ("not published", unpublished),
        ("messages malformed", malformed),
    ]
    .map(|(what, count)| KeyValue::new(&format!("{name} {what}"), count))
}

fn link_status(session: &mut Session, wire: &Counters) -> DiagnosticStatus {
    let damaged = [wire.crc, wire.cobs, wire.oversize, wire.malformed];
    let damaged = damaged.into_iter().fold(0, u32::wrapping_add);
    let since = damaged.wrapping_sub(session.counts.damaged_reported);
    session.counts.damaged_reported = damaged;
    // Log no damage before the first valid frame: the bytes may come from another kind of device.
    if wire.frames > 0 {
        session.link_log.add_damaged(since);
    }
    let state = if wire.version > 0 && wire.frames == 0 {
        let message = "the device speaks another version of the wire format; bring firmware and \
                       bridge to the same release";
        (DiagnosticLevel::Error, message.to_owned())
    } else if since > 0 {
        let message = format!("{since} frames damaged since the last report");
        (DiagnosticLevel::Warn, message)
    } else {
        (DiagnosticLevel::Ok, format!("{} frames", wire.frames))
    };
    let values = vec![
        KeyValue::new("bytes", &wire.bytes),
        KeyValue::new("frames", &wire.frames),
        KeyValue::new("frames lost", &session.frames.lost),
        KeyValue::new("frames replayed", &session.frames.replays),
        KeyValue::new("CRC errors", &wire.crc),
        KeyValue::new("COBS errors", &wire.cobs),
        KeyValue::new("oversize", &wire.oversize),
        KeyValue::new("other version", &wire.version),
        KeyValue::new("newer messages", &wire.unknown),
        KeyValue::new("malformed", &wire.malformed),
        KeyValue::new("resyncs", &wire.resyncs),
    ];
    DiagnosticStatus::new("link", state, values)
}

/// Rate error of the device's clock above which the status warns, ppm. Crystals and resonators stay
/// below it, RC oscillators do not.
const MAX_DRIFT_PPM: f64 = 1_000.0;

fn clock_status(session: &Session, now: HostTime) -> DiagnosticStatus {
    let clock = &session.clock;
    let samples = [&session.side.raw, &session.side.filtered].into_iter();
    let samples = samples.flatten().map(|stream| stream.stamps.moved);
    let codes = session.codes.as_ref().map(CodeStream::moved_stamps);
    let packed = session.packed.as_ref().map(|packed| packed.stamps.moved);
    let moved: u64 = samples.chain(codes).chain(packed).sum();
    let drift_ppm = clock.drift_ppm();
    let state = if clock.is_settled() && drift_ppm.abs() > MAX_DRIFT_PPM {
        let direction = if drift_ppm > 0.0 { "slow" } else { "fast" };
        let message = format!(
            "the device's clock is {:.0} ppm {direction}; the stamps are corrected, but a crystal \
             is exact to 100 ppm. A NUCLEO runs from an RC oscillator: that of its ST-LINK, until \
             that is set to 8.33 MHz (docs/hardware.md), or its own, if `device` reports no clock of the \
             ST-LINK. An amplifier of another make does not run at the rate that it states: see \
             its data sheet",
            drift_ppm.abs()
        );
        (DiagnosticLevel::Warn, message)
    } else {
        (DiagnosticLevel::Ok, format!("{drift_ppm:+.1} ppm"))
    };
    let mut values = vec![
        KeyValue::new("drift ppm", &format!("{drift_ppm:+.2}")),
        KeyValue::new("residual us", &format!("{:.0}", clock.residual_us())),
        KeyValue::new("newest delay us", &format!("{:.0}", clock.newest_delay_us())),
        KeyValue::new("host clock steps", &clock.wall_steps()),
        KeyValue::new("impossible device times", &clock.refused()),
        KeyValue::new("stamps held", &moved),
        KeyValue::new("impossible answers", &session.round_trips.impossible),
    ];
    if let Some(trip) = session.round_trips.shortest(now) {
        let (transit_us, half) = (trip.transit_us, trip.transit_us / 2.0);
        values.push(KeyValue::new("round trip us", &format!("{transit_us:.0}")));
        values.push(KeyValue::new("offset known to +- us", &format!("{half:.0}")));
        let [least, most] = trip.late_us.map(|us| us.max(0.0));
        let late = format!("{least:.0} to {most:.0}");
        values.push(KeyValue::new("stamps late by us", &late));
    }
    DiagnosticStatus::new("clock", state, values)
}
