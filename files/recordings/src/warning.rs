//! Warnings about defects of a file that do not prevent reading it.

use thiserror::Error;

/// A defect of a file that can still be read. A recording states each defect once.
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages say what each field means")]
pub enum Warning {
    /// The header states -1 records, so the number was derived from the size of the file.
    #[error(
        "the header does not contain the number of records (-1); the size of the file yields {derived}"
    )]
    RecordsUnknown { derived: u64 },
    /// The file ends before the last record announced in its header.
    #[error(
        "the file is truncated: the header announces {promised} records, {whole} are complete and used, \
         {left_over} bytes of an incomplete one are ignored"
    )]
    Truncated {
        promised: u64,
        whole: u64,
        left_over: u64,
    },
    /// An EDF or BDF file has bytes after the last record announced in its header.
    #[error("{bytes} bytes after the last announced record are ignored")]
    Surplus { bytes: u64 },
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
    /// The digital minimum of a signal is above its maximum. It is scaled as the header states, so
    /// its polarity may be reversed.
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
    /// Some annotation bytes are not valid time-stamped annotation lists.
    #[error("annotations of {records} records could not be read completely")]
    Annotations { records: u64 },
}
