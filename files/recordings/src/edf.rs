//! Parses the headers of EDF, EDF+, BDF and BDF+ files: ASCII fields of fixed width.
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
        HEADER_BLOCK, Header, SignalFields, calibration, field_error, record_count,
        record_duration, sampling_rate, text,
    },
    ratio::Ratio,
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

/// Returns whether a header whose version field names neither EDF nor BDF is nevertheless an EDF
/// header: the version is text, and the stated header length is exactly what the number of signals
/// needs. Emotiv's programs, for example, write a date as the version.
pub(crate) fn is_other_version(fixed: &[u8; HEADER_BLOCK]) -> bool {
    let is_text = fixed[..8].iter().all(|byte| matches!(byte, b' '..=b'~'));
    let length = signal_count(fixed).map(|signals| HEADER_BLOCK * (1 + signals));
    is_text && length.is_ok_and(|length| text(&fixed[184..192]).parse() == Ok(length))
}

/// Parses a whole header, [`HEADER_BLOCK`] * (1 + number of signals) bytes long.
///
/// # Errors
/// [`RecordingError::HeaderField`] for a field that does not hold a valid number,
/// [`RecordingError::Range`] if no signal can be scaled.
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
        warnings.push(Warning::HeaderLength { stated, used: bytes.len() as u64 });
    }
    let format = variant(family, &text(&bytes[192..236]));
    let (field, found) = ("number of records", &bytes[236..244]);
    let records = record_count(number(found, field, "the file")?)?;
    let mut commas = Vec::new();
    let record_duration = duration(&bytes[244..252], &mut commas, &mut warnings)?;

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
        let is_annotation = ANNOTATIONS.contains(&label.as_str());
        let (kind, calibration) = if is_annotation {
            (SignalKind::Annotations, Ok(Calibration::IDENTITY))
        } else {
            let digital = [digital_min[i], digital_max[i]];
            let physical = [physical_min[i], physical_max[i]];
            let mut real = |bytes, field| decimal(bytes, field, &place, &mut commas);
            let ranges = [
                digital.map(|bytes| {
                    let is_whole = !has_grouped_digits(bytes);
                    is_whole.then(|| real(bytes, "digital limit")).flatten()
                }),
                physical.map(|bytes| real(bytes, "physical limit")),
            ];
            let ranges = ranges.map(|ends| ends.map(|end| end.unwrap_or(f64::NAN)));
            let stated = || [digital, physical].map(|ends| ends.map(text));
            let line = calibration(&label, sample_type, ranges, stated, &mut warnings);
            (SignalKind::Samples, line)
        };
        list.push(Signal {
            kind,
            unit: Unit::from_text(&text(units[i])),
            calibration,
            sample_type,
            samples_per_record,
            rate: sampling_rate(samples_per_record, record_duration),
            label,
        });
    }
    if !commas.is_empty() {
        warnings.push(Warning::DecimalComma { fields: commas });
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

/// Parses the duration of a record, s; `None` if it is 0. A number that fills its whole field has
/// been rounded to fit, such as `.0019531` for 1/512. It is taken as the simplest fraction that
/// rounds to this text; if that fraction differs from the number, a warning is added.
/// # Errors
/// [`RecordingError::HeaderField`] if the field is not a number, and the errors of
/// [`record_duration`].
fn duration(
    bytes: &[u8],
    commas: &mut Vec<String>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Ratio>, RecordingError> {
    let field = "duration of a record";
    let Some(seconds) = decimal(bytes, field, "the file", commas) else {
        return Err(not_a_number(bytes, field, "the file"));
    };
    let exact = record_duration(seconds)?;
    let stated = text(bytes);
    let decimals = match stated.split_once(['.', ',']) {
        Some((_, decimals)) if stated.len() == bytes.len() => decimals,
        _ => return Ok(exact),
    };
    if !decimals.bytes().all(|byte| byte.is_ascii_digit()) {
        return Ok(exact);
    }
    let places = i32::try_from(decimals.len()).unwrap_or(0);
    // Slightly more than half a unit of the last digit, so that the interval contains 0.0078125
    // even if the file rounds it down to 0.007812.
    let half = 0.500_001 * 10_f64.powi(-places);
    let simplest = Ratio::simplest(seconds - half, seconds + half);
    match simplest {
        Some(used) if simplest != exact => {
            warnings.push(Warning::DurationRounded { stated, used });
            Ok(simplest)
        }
        _ => Ok(exact),
    }
}

/// Returns whether a comma is followed by any digit other than 0. In an integer, such as the
/// digital limit -32,768, such a comma groups digits and is not a decimal comma.
fn has_grouped_digits(bytes: &[u8]) -> bool {
    let digits = text(bytes);
    let rest = digits.split_once(',').map_or("", |(_, rest)| rest);
    rest.bytes().any(|digit| digit != b'0')
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
    let parsed = text(bytes).parse();
    parsed.map_err(|_| not_a_number(bytes, field, place))
}

fn not_a_number(bytes: &[u8], field: &'static str, place: &str) -> RecordingError {
    let found = bytes.trim_ascii().escape_ascii().to_string();
    field_error(field, place, &found, "a plain number is required")
}

/// Parses a number with an optional decimal point. A decimal comma violates the format but is
/// accepted; its field is added to `commas`. `None` if the text is not a number.
fn decimal(bytes: &[u8], field: &str, place: &str, commas: &mut Vec<String>) -> Option<f64> {
    let stated = text(bytes);
    let value = stated.replace(',', ".").parse().ok();
    if value.is_some() && stated.contains(',') {
        commas.push(format!("\"{stated}\" ({field} of {place})"));
    }
    value
}
