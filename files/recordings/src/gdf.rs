//! Parses the headers of GDF 1.x and 2.x files, which are binary and little-endian.
//!
//! Source: A. Schlögl, "GDF - A general dataformat for biosignals", arXiv cs/0608052 and later
//! versions of the specification. The headers of both versions have 256 bytes for each signal.

pub(crate) mod events;
pub(crate) mod writer;

use crate::{
    error::RecordingError,
    format::Format,
    header::{
        HEADER_BLOCK, Header, SignalFields, array_at, calibration, field_error, record_count,
        record_duration, sampling_rate, text,
    },
    ratio::Ratio,
    signal::{SampleType, Signal, SignalKind, Unit},
    warning::Warning,
};

/// Version from which GDF headers store the record duration as a float64, not as two u32: 2.21. The
/// constant is halfway between 2.20 and 2.21, to tolerate rounding of the parsed version.
const FLOAT_DURATION: f64 = 2.205;

/// Reads the number of signals, 1..=65535, from `fixed`, the first [`HEADER_BLOCK`] bytes of a
/// file.
///
/// # Errors
/// [`RecordingError::HeaderField`] if the number is 0 or too large.
pub(crate) fn signal_count(
    format: Format,
    fixed: &[u8; HEADER_BLOCK],
) -> Result<usize, RecordingError> {
    let count = match format {
        Format::Gdf1(_) => u32::from_le_bytes(array_at(fixed, 252)),
        _ => u32::from(u16::from_le_bytes(array_at(fixed, 252))),
    };
    // GDF 1 stores the number in 32 bits, but only damaged files have more than 65,535 signals.
    if let Ok(count @ 1..) = u16::try_from(count) {
        return Ok(usize::from(count));
    }
    let (found, reason) = (count.to_string(), "it must be 1..=65535");
    Err(field_error("number of signals", "the file", &found, reason))
}

/// Parses a whole header, [`HEADER_BLOCK`] * (1 + number of signals) bytes long.
///
/// # Errors
/// [`RecordingError::HeaderField`] for an unusable field, [`RecordingError::SampleType`] for an
/// unsupported type, [`RecordingError::Range`] if no signal can be scaled.
pub(crate) fn parse(
    format: Format,
    bytes: &[u8],
    signals: usize,
) -> Result<Header, RecordingError> {
    let data_start = match format {
        Format::Gdf1(_) => u64::from_le_bytes(array_at(bytes, 184)),
        _ => u64::from(u16::from_le_bytes(array_at(bytes, 184))) * HEADER_BLOCK as u64,
    };
    if data_start < bytes.len() as u64 {
        let found = data_start.to_string();
        let reason = "it is shorter than its signals need";
        return Err(field_error("length of the header", "the file", &found, reason));
    }
    let records = record_count(i64::from_le_bytes(array_at(bytes, 236)))?;
    let record_duration = duration(format, bytes)?;
    let mut warnings = Vec::new();
    Header {
        format,
        signals: parse_signals(format, bytes, signals, record_duration, &mut warnings)?,
        data_start,
        records,
        record_duration,
        warnings,
    }
    .checked()
}

fn duration(format: Format, bytes: &[u8]) -> Result<Option<Ratio>, RecordingError> {
    if let Format::Gdf2(version) = format
        && version >= FLOAT_DURATION
    {
        return record_duration(f64::from_le_bytes(array_at(bytes, 244)));
    }
    let numerator = u32::from_le_bytes(array_at(bytes, 244));
    let denominator = u32::from_le_bytes(array_at(bytes, 248));
    if denominator == 0 {
        let (found, reason) = (format!("{numerator}/0"), "its denominator is 0");
        return Err(field_error("duration of a record", "the file", &found, reason));
    }
    Ok(Ratio::new(numerator.into(), denominator.into()))
}

/// Parses the header fields of all signals. GDF 1 and 2 encode units and digital limits
/// differently, and also differ in the fields that are skipped.
fn parse_signals(
    format: Format,
    bytes: &[u8],
    signals: usize,
    duration: Option<Ratio>,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Signal>, RecordingError> {
    let is_version_1 = matches!(format, Format::Gdf1(_));
    let mut fields = SignalFields::new(bytes, signals);
    let labels = fields.next_field(16);
    let _transducers = fields.next_field(80);
    // GDF 1 states units as texts of 8 bytes; GDF 2 as texts of 6 bytes for all signals, followed
    // by a code (u16) for each signal.
    let (units, unit_codes) = if is_version_1 {
        (fields.next_field(8), Vec::new())
    } else {
        (fields.next_field(6), fields.next_field(2))
    };
    let [physical_min, physical_max, digital_min, digital_max] = fields.next_ranges();
    // Skips the prefilter texts; in GDF 2, time offset, low-pass, high-pass and notch as well.
    let _filters = fields.next_field(80);
    let samples = fields.next_field(4);
    let types = fields.next_field(4);
    let float = |raw: &[u8]| f64::from_le_bytes(array_at(raw, 0));
    #[expect(clippy::cast_precision_loss, reason = "digital limits beyond 2^53 are rounded")]
    let digital = |raw: &[u8]| match format {
        Format::Gdf1(_) => i64::from_le_bytes(array_at(raw, 0)) as f64,
        _ => float(raw),
    };
    let mut parse_signal = |i: usize| {
        let label = text(labels[i]);
        let number = u32::from_le_bytes(array_at(types[i], 0));
        let samples_per_record = u32::from_le_bytes(array_at(samples[i], 0));
        let Some(sample_type) = SampleType::from_gdf(number) else {
            return Err(RecordingError::SampleType { label, number });
        };
        let unit = if is_version_1 {
            Unit::from_text(&text(units[i]))
        } else {
            let code = u16::from_le_bytes(array_at(unit_codes[i], 0));
            Unit::from_gdf_code(code, &text(units[i]))
        };
        let ranges = [
            [digital_min[i], digital_max[i]].map(digital),
            [physical_min[i], physical_max[i]].map(float),
        ];
        let stated = || ranges.map(|ends| ends.map(|end| end.to_string()));
        Ok(Signal {
            kind: SignalKind::Samples,
            unit,
            calibration: calibration(&label, sample_type, ranges, stated, warnings),
            sample_type,
            samples_per_record,
            rate: sampling_rate(samples_per_record, duration),
            label,
        })
    };
    (0..signals).map(&mut parse_signal).collect()
}
