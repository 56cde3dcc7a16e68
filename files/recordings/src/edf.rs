//! Parses the headers of EDF, EDF+, BDF and BDF+ files, whose fields have fixed widths in ASCII.
//!
//! Sources: Kemp et al. 1992 (EDF), Kemp and Olivan 2003 (EDF+), BioSemi's description of BDF.

pub(crate) mod annotations;
mod date;
pub(crate) mod writer;

use std::str::FromStr;

use crate::{
    error::RecordingError,
    format::Format,
    header::{
        HEADER_BLOCK, Header, SignalFields, field_error, record_count, record_duration,
        sampling_rate, text,
    },
    signal::{Calibration, SampleType, Signal, SignalKind, Unit},
    warning::Warning,
};

/// Labels of the signals that contain annotations.
const ANNOTATIONS: [&str; 2] = ["EDF Annotations", "BDF Annotations"];

/// Reads the number of signals, 1..=9999, from `fixed`, the first [`HEADER_BLOCK`] bytes of a file.
///
/// # Errors
/// [`RecordingError::HeaderField`] if the field holds anything else.
pub(crate) fn signal_count(fixed: &[u8; HEADER_BLOCK]) -> Result<usize, RecordingError> {
    let (field, bytes) = ("number of signals", &fixed[252..256]);
    match number(bytes, field, "the file")? {
        0 => Err(field_error(field, "the file", "0", "it is 0")),
        count => Ok(count),
    }
}

/// Parses a whole header, [`HEADER_BLOCK`] * (1 + number of signals) bytes long.
///
/// # Errors
/// [`RecordingError::HeaderField`] for a field that does not hold a valid number,
/// [`RecordingError::Range`] for a signal that cannot be scaled.
pub(crate) fn parse(
    family: Format,
    bytes: &[u8],
    signals: usize,
) -> Result<Header, RecordingError> {
    let sample_type = match family {
        Format::Bdf => SampleType::Signed(3),
        _ => SampleType::Signed(2),
    };
    let mut warnings = Vec::new();
    let stated = text(&bytes[184..192]);
    if stated.parse() != Ok(bytes.len()) {
        warnings.push(Warning::HeaderLength {
            stated,
            used: bytes.len() as u64,
        });
    }
    let format = variant(family, &text(&bytes[192..236]));
    let (field, found) = ("number of records", &bytes[236..244]);
    let records = record_count(number(found, field, "the file")?)?;
    let (field, found) = ("duration of a record", &bytes[244..252]);
    let record_duration = record_duration(number(found, field, "the file")?)?;

    let mut fields = SignalFields::new(bytes, signals);
    let labels = fields.next_field(16);
    let _transducers = fields.next_field(80);
    let units = fields.next_field(8);
    let [physical_min, physical_max, digital_min, digital_max] = fields.next_ranges();
    let _prefilters = fields.next_field(80);
    let samples = fields.next_field(8);

    let mut list = Vec::with_capacity(signals);
    for i in 0..signals {
        let label = text(labels[i]);
        let place = format!("signal {} ({label})", i + 1);
        let samples_per_record: u32 = number(samples[i], "samples per record", &place)?;
        let kind = if ANNOTATIONS.contains(&label.as_str()) {
            SignalKind::Annotations
        } else {
            SignalKind::Samples
        };
        list.push(Signal {
            kind,
            unit: Unit::from_text(&text(units[i])),
            calibration: Calibration {
                physical_min: number(physical_min[i], "physical minimum", &place)?,
                physical_max: number(physical_max[i], "physical maximum", &place)?,
                digital_min: number(digital_min[i], "digital minimum", &place)?,
                digital_max: number(digital_max[i], "digital maximum", &place)?,
            },
            sample_type,
            samples_per_record,
            rate: sampling_rate(samples_per_record, record_duration),
            label,
        });
    }
    Header {
        format,
        signals: list,
        data_start: bytes.len() as u64,
        records,
        record_duration,
        warnings,
    }
    .checked()
}

fn variant(family: Format, reserved: &str) -> Format {
    match (family, reserved.get(..5)) {
        (Format::Edf, Some("EDF+C")) => Format::EdfPlusContinuous,
        (Format::Edf, Some("EDF+D")) => Format::EdfPlusDiscontinuous,
        (Format::Bdf, Some("BDF+C")) => Format::BdfPlusContinuous,
        (Format::Bdf, Some("BDF+D")) => Format::BdfPlusDiscontinuous,
        _ => family,
    }
}

fn number<T: FromStr>(bytes: &[u8], field: &'static str, place: &str) -> Result<T, RecordingError> {
    text(bytes).parse().map_err(|_| {
        let found = bytes.trim_ascii().escape_ascii().to_string();
        field_error(field, place, &found, "a plain number is required")
    })
}
