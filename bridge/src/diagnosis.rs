//! What goes to `/diagnostics`.

use link::Counters;
use neuro_ros::{DiagnosticArray, DiagnosticLevel, DiagnosticStatus, Header, KeyValue, Stamp};

use crate::HostTime;
use crate::code_stream::CodeStream;
use crate::session::Session;
use crate::signal_quality::signal_quality;
use crate::timing::timing;

/// What goes to `/diagnostics`: device, loss, link and clock; the electrodes and the deadlines once
/// per report of the device.
pub(crate) fn diagnose(session: &mut Session, wire: &Counters, now: HostTime) -> DiagnosticArray {
    let header = Header {
        stamp: Stamp::from_nanoseconds(now.wall_ns),
        ..Header::default()
    };
    let hardware = session.codes.as_ref().map_or_else(String::new, |codes| {
        let device = codes.device();
        format!("{} {}", device.board, device.uid)
    });
    let mut status = vec![
        device(session, now),
        loss(session),
        link(session, wire),
        clock(session),
    ];
    if let Some((quality, codes)) = session.quality.take().zip(session.codes.as_ref()) {
        status.push(signal_quality(&quality, &codes.device().labels));
    }
    if let Some(report) = session.timing.take() {
        status.push(timing(&report));
    }
    for status in &mut status {
        status.name.insert_str(0, "corticode: ");
        status.hardware_id.clone_from(&hardware);
    }
    DiagnosticArray { header, status }
}

pub(crate) fn entry(
    name: &str,
    (level, message): (DiagnosticLevel, String),
    values: Vec<KeyValue>,
) -> DiagnosticStatus {
    let hardware_id = String::new();
    DiagnosticStatus {
        level,
        name: name.to_owned(),
        message,
        hardware_id,
        values,
    }
}

fn device(session: &Session, now: HostTime) -> DiagnosticStatus {
    let usable = session.commands.accepts_codes();
    let (level, message) = match (&session.objection, session.introduced) {
        (_, false) => (DiagnosticLevel::Stale, "no device answers".to_owned()),
        (Some(objection), _) if usable => (DiagnosticLevel::Warn, objection.clone()),
        (Some(objection), _) => (DiagnosticLevel::Error, objection.clone()),
        (None, true) if session.commands.is_starved(now.monotonic_us) => (
            DiagnosticLevel::Warn,
            "the device should stream and sends no codes; it is asked again".to_owned(),
        ),
        (None, true) if session.commands.streaming() => {
            (DiagnosticLevel::Ok, "streaming".to_owned())
        }
        (None, true) => (DiagnosticLevel::Ok, "not streaming".to_owned()),
    };
    let mut values = vec![
        KeyValue::new("connections", &session.counts.connections),
        KeyValue::new("resets", &session.counts.resets),
        KeyValue::new("codes unused", &session.counts.early),
    ];
    if let Some(codes) = &session.codes {
        let device = codes.device();
        values.push(KeyValue::new("firmware", &device.firmware));
        values.push(KeyValue::new("mains Hz", &device.mains_hz));
        values.push(KeyValue::new("code format", &device.code_format));
        values.push(KeyValue::new(
            "codes of another model or format",
            &codes.counts().foreign,
        ));
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
    entry("device", (level, message), values)
}

fn loss(session: &mut Session) -> DiagnosticStatus {
    let counts = session.codes.as_ref().map(|codes| codes.counts().clone());
    let counts = counts.unwrap_or_default();
    let ledger = &counts.ledger;
    let since = ledger.lost() - session.counts.lost_told;
    session.counts.lost_told = ledger.lost();
    let state = match since {
        0 => (DiagnosticLevel::Ok, "nothing lost".to_owned()),
        lost => (
            DiagnosticLevel::Warn,
            format!("{lost} codes lost since the last report"),
        ),
    };
    let values = vec![
        KeyValue::new("made", &ledger.made()),
        KeyValue::new("received", &ledger.received()),
        KeyValue::new("lost", &ledger.lost()),
        KeyValue::new("bursts", &ledger.bursts()),
        KeyValue::new("longest burst", &ledger.longest_burst()),
        KeyValue::new("fillers", &counts.fillers),
        KeyValue::new("lost and not filled", &counts.unfilled),
        KeyValue::new("values clipped", &counts.clipped),
        KeyValue::new("code values clipped", &counts.clipped_values),
    ];
    entry("loss", state, values)
}

fn link(session: &mut Session, wire: &Counters) -> DiagnosticStatus {
    let damaged = [wire.crc, wire.cobs, wire.oversize, wire.malformed];
    let damaged = damaged.into_iter().fold(0, u32::wrapping_add);
    let since = damaged.wrapping_sub(session.counts.damaged_told);
    session.counts.damaged_told = damaged;
    if since > 0 {
        tracing::warn!(since, "frames damaged; check cable, connectors and --baud");
    }
    let state = if wire.version > 0 && wire.frames == 0 {
        let message = "the device speaks another version of the wire format; bring firmware and \
                       bridge to the same release";
        (DiagnosticLevel::Error, message.to_owned())
    } else if since > 0 {
        (
            DiagnosticLevel::Warn,
            format!("{since} frames damaged since the last report"),
        )
    } else {
        (DiagnosticLevel::Ok, format!("{} frames", wire.frames))
    };
    let values = vec![
        KeyValue::new("bytes", &wire.bytes),
        KeyValue::new("frames", &wire.frames),
        KeyValue::new("frames lost", &session.frames.lost()),
        KeyValue::new("frames replayed", &session.frames.replays()),
        KeyValue::new("CRC errors", &wire.crc),
        KeyValue::new("COBS errors", &wire.cobs),
        KeyValue::new("oversize", &wire.oversize),
        KeyValue::new("other version", &wire.version),
        KeyValue::new("newer messages", &wire.unknown),
        KeyValue::new("malformed", &wire.malformed),
        KeyValue::new("resyncs", &wire.resyncs),
    ];
    entry("link", state, values)
}

fn clock(session: &Session) -> DiagnosticStatus {
    let clock = &session.clock;
    let held = session.codes.as_ref().map_or(0, CodeStream::held_stamps);
    let message = format!("{:+.1} ppm", clock.drift_ppm());
    let values = vec![
        KeyValue::new("drift ppm", &format!("{:+.2}", clock.drift_ppm())),
        KeyValue::new("residual us", &format!("{:.0}", clock.residual_us())),
        KeyValue::new(
            "newest delay us",
            &format!("{:.0}", clock.newest_delay_us()),
        ),
        KeyValue::new("host clock steps", &clock.wall_steps()),
        KeyValue::new("impossible device times", &clock.refused()),
        KeyValue::new("stamps held", &held),
    ];
    entry("clock", (DiagnosticLevel::Ok, message), values)
}
