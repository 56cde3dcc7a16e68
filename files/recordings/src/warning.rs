//! Warnings about defects of a file that do not prevent reading it.

use thiserror::Error;

use crate::ratio::Ratio;

/// A defect of a file that can still be read. A recording reports each defect once.
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages say what each field means")]
pub enum Warning {
    /// The header states -1 or 0 records, so the number was derived from the size of the file.
    #[error(
        "the header does not contain the number of records (it is -1 or 0); the size of the file yields {derived}"
    )]
    RecordsUnknown { derived: u64 },
    /// The file ends before the last record announced in its header.
    #[error(
        "the file is truncated: the header announces {promised} records, {whole} are complete and used, \
         {left_over} bytes of an incomplete one are ignored"
    )]
    Truncated { promised: u64, whole: u64, left_over: u64 },
    /// An EDF or BDF file has bytes after the last record announced in its header: `records` whole
    /// records, together `seconds` long, and `bytes` further bytes.
    #[error("{}", surplus(*records, *seconds, *bytes))]
    Surplus { records: u64, seconds: f64, bytes: u64 },
    /// The first field of an EDF file is not the version of the format, which is 0.
    #[error("the version in the header is '{found}' in place of 0; the file is read as EDF")]
    Version { found: String },
    /// Header fields of an EDF or BDF file have a decimal comma. `fields` lists them with their
    /// content.
    #[error(
        "a decimal comma is read as a point in {} header fields, such as {}; check the scale, and repair the header",
        fields.len(), fields[0]
    )]
    DecimalComma { fields: Vec<String> },
    /// The field for the duration of a record is too narrow for all digits; `used` is the simplest
    /// fraction that rounds to the stated text.
    #[error(
        "the header rounds the duration of a record to {stated} s; {}/{} s are used",
        used.numerator(), used.denominator()
    )]
    DurationRounded { stated: String, used: Ratio },
    /// Triggers are stored as bits of a signal, as by BioSemi's devices, and are not read as
    /// events.
    #[error(
        "the triggers in signal {label} are not read as events; store them as annotations (docs/recordings.md, \
         Formats)"
    )]
    Triggers { label: String },
    /// Some signals cannot be scaled, because their ranges are empty or not numbers. `signals`
    /// lists label and ranges of each.
    #[error(
        "signals that cannot be scaled are left out, repair the header to use them: {}",
        signals.join(", ")
    )]
    Unusable { signals: Vec<String> },
    /// The length field of the header contradicts its number of signals.
    #[error(
        "the header states a length of '{stated}' bytes, its signals need {used}; using {used}"
    )]
    HeaderLength { stated: String, used: u64 },
    /// The units of some signals are not voltages; the virtual ADC treats their values as uV. The
    /// field lists label and unit of each such signal, such as `Status (Boolean)`.
    #[error(
        "unit is not a known voltage, values are treated as uV where a voltage is needed: {}",
        signals.join(", ")
    )]
    UnitUnknown { signals: Vec<String> },
    /// The physical range of a signal is empty, so its digital values are returned without scaling.
    #[error("signal {label}: the physical range is empty, digital values are used")]
    PhysicalRangeEmpty { label: String },
    /// The digital minimum of a signal is above its maximum. The signal is scaled as the header
    /// states, so its polarity may be reversed.
    #[error(
        "signal {label}: the digital minimum is above the maximum, so its polarity may be reversed; \
         check it, and repair the header"
    )]
    DigitalRangeReversed { label: String },
    /// An EDF+D or BDF+D file has gaps: a record does not start at the end of the previous one. The
    /// records are played without the gaps.
    #[error("{count} gaps between records, {seconds} s in total, are closed")]
    Gaps { count: u64, seconds: f64 },
    /// The GDF event table is truncated or has an unknown mode, so no events are returned.
    #[error(
        "the event table announces {announced} events but only {bytes} bytes of it are readable; no \
         events are returned"
    )]
    EventTable { announced: u32, bytes: u64 },
    /// The times of some records of an EDF+D or BDF+D file are missing, or not after the previous
    /// record's time. Each such record is assumed to start at the end of the previous record.
    #[error(
        "{records} records have no time, or one not after that of the record before them; their events may be \
         misplaced"
    )]
    RecordTimes { records: u64 },
    /// Some annotation lists are invalid, so their annotations are missing; `first` is the start of
    /// the first invalid list.
    #[error("{lists} annotation lists cannot be read and are left out, the first is \"{first}\"")]
    Annotations { lists: u64, first: String },
    /// Sparse samples of a GDF event table are not events and are not played.
    #[error("{count} sparse samples in the event table are not played")]
    SparseSamples { count: u64 },
}

/// Returns the text of [`Warning::Surplus`].
fn surplus(records: u64, seconds: f64, bytes: u64) -> String {
    if records == 0 {
        return format!("{bytes} bytes after the last announced record are ignored");
    }
    format!(
        "{records} records ({seconds:.3} s) and {bytes} bytes after the last announced record are ignored; to play \
         the records too, write -1 in place of their number (the 8 bytes at byte 236 of the file)"
    )
}
