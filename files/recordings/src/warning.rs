//! Warnings about defects of a file that do not prevent reading it.

use std::fmt;

/// A defect of a file that can still be read. A recording reports each warning once.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// The header states -1 records, so the number of records was derived from the size of the
    /// file.
    RecordsUnknown {
        /// Number of whole records in the file, without its event table.
        derived: u64,
    },
    /// The file ends before the last record announced in its header.
    Truncated {
        /// Number of records announced in the header.
        promised: u64,
        /// Number of whole records in the file, all of which are read.
        whole: u64,
        /// Number of bytes of an incomplete last record, which are ignored.
        left_over: u64,
    },
    /// An EDF or BDF file continues after its last announced record.
    Surplus {
        /// Number of bytes after the last record, which are ignored.
        bytes: u64,
    },
    /// The length field of the header contradicts its number of signals.
    HeaderLength {
        /// Content of the length field, as text.
        stated: String,
        /// Length computed from the number of signals, bytes; the reader uses this length.
        used: u64,
    },
    /// The units of some signals are not voltages. The virtual ADC treats their values as uV.
    UnitUnknown {
        /// Label and unit of each signal, such as `Status (Boolean)`.
        signals: Vec<String>,
    },
    /// The physical range of a signal is empty. The digital values of the signal are returned
    /// unscaled.
    PhysicalRangeEmpty {
        /// Label of the signal as in the file.
        label: String,
    },
    /// The digital minimum of a signal is above its maximum. The signal is scaled as the header
    /// states.
    DigitalRangeReversed {
        /// Label of the signal as in the file.
        label: String,
    },
    /// An EDF+D or BDF+D file has gaps between records. The records are played without the gaps.
    Gaps {
        /// Number of places at which a record does not start at the end of the previous record.
        count: u64,
        /// Total duration of all gaps, s.
        seconds: f64,
    },
    /// The GDF event table is truncated or has an unknown mode. No events are returned.
    EventTable {
        /// Number of events that the table announces.
        announced: u32,
        /// Number of bytes after the last record.
        bytes: u64,
    },
    /// Some annotation bytes are not a valid time-stamped annotation list.
    Annotations {
        /// Number of records with unreadable annotations.
        records: u64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RecordsUnknown { derived } => write!(
                f,
                "the header does not contain the number of records (-1); \
                 the size of the file yields {derived}"
            ),
            Self::Truncated {
                promised,
                whole,
                left_over,
            } => write!(
                f,
                "the file is truncated: the header announces {promised} records, {whole} are \
                 complete and used, {left_over} bytes of an incomplete one are ignored"
            ),
            Self::Surplus { bytes } => {
                write!(
                    f,
                    "{bytes} bytes after the last announced record are ignored"
                )
            }
            Self::HeaderLength { stated, used } => write!(
                f,
                "the header states a length of '{stated}' bytes, its signals need {used}; using {used}"
            ),
            Self::UnitUnknown { signals } => write!(
                f,
                "unit is not a known voltage, values are treated as uV where a voltage is needed: {}",
                signals.join(", ")
            ),
            Self::PhysicalRangeEmpty { label } => {
                write!(
                    f,
                    "signal {label}: the physical range is empty, digital values are used"
                )
            }
            Self::DigitalRangeReversed { label } => {
                write!(
                    f,
                    "signal {label}: the digital minimum is above the maximum, so its polarity may be \
                     reversed; check it, and repair the header"
                )
            }
            Self::Gaps { count, seconds } => {
                write!(
                    f,
                    "{count} gaps between records, {seconds} s in total, are closed"
                )
            }
            Self::EventTable { announced, bytes } => write!(
                f,
                "the event table announces {announced} events but only {bytes} bytes of it are \
                 readable; no events are returned"
            ),
            Self::Annotations { records } => {
                write!(
                    f,
                    "annotations of {records} records could not be read completely"
                )
            }
        }
    }
}
