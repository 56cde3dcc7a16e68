//! What a reader had to decide for a file that does not keep its own promises.

use std::fmt;

/// Something that a file gets wrong but can still be read with; each is reported once.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// The header gives -1 records; the number was derived from the file's size.
    RecordsUnknown {
        /// Whole records that the file holds, in front of its event table if it has one.
        derived: u64,
    },
    /// The file ends before the records that its header promises.
    Truncated {
        /// Records that the header promises.
        promised: u64,
        /// Whole records that the file holds; these are served.
        whole: u64,
        /// Bytes of a last, incomplete record; these are left out.
        left_over: u64,
    },
    /// An EDF or BDF file goes on behind its last announced record.
    Surplus {
        /// Bytes behind the last record; they are left out.
        bytes: u64,
    },
    /// The header's own length field disagrees with its number of signals.
    HeaderLength {
        /// What the field says, as text.
        stated: String,
        /// Bytes that so many signals take; this is used.
        used: u64,
    },
    /// Units that are no voltage; their values are taken as uV where a voltage is needed.
    UnitUnknown {
        /// Labels and units, such as `Status (Boolean)`.
        signals: Vec<String>,
    },
    /// A signal's physical range is empty; its digital values are served.
    PhysicalRangeEmpty {
        /// Label of the signal.
        label: String,
    },
    /// Records of an EDF+D or BDF+D file lie apart; they are played without the gaps.
    Gaps {
        /// How many there are.
        count: u64,
        /// Their sum, s.
        seconds: f64,
    },
    /// The GDF event table is cut off or unreadable; no events are served.
    EventTable {
        /// Events that it announces.
        announced: u32,
        /// Bytes that are there.
        bytes: u64,
    },
    /// Annotation bytes that are not a time-stamped annotation list.
    Annotations {
        /// Records whose annotations could not be read to their end.
        records: u64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RecordsUnknown { derived } => write!(
                f,
                "the header does not say how many records there are (-1); \
                 the file's size gives {derived}"
            ),
            Self::Truncated {
                promised,
                whole,
                left_over,
            } => write!(
                f,
                "the file is cut off: {promised} records promised, {whole} whole ones are there \
                 and served, {left_over} bytes of an incomplete one are left out"
            ),
            Self::Surplus { bytes } => {
                write!(
                    f,
                    "{bytes} bytes behind the last announced record are left out"
                )
            }
            Self::HeaderLength { stated, used } => write!(
                f,
                "the header says it is {stated:?} bytes long, its signals take {used}; using {used}"
            ),
            Self::UnitUnknown { signals } => write!(
                f,
                "no known unit of voltage, values taken as uV where a voltage is needed: {}",
                signals.join(", ")
            ),
            Self::PhysicalRangeEmpty { label } => {
                write!(
                    f,
                    "signal {label}: the physical range is empty, serving digital values"
                )
            }
            Self::Gaps { count, seconds } => {
                write!(
                    f,
                    "{count} gaps between records, {seconds} s together, are played as if closed"
                )
            }
            Self::EventTable { announced, bytes } => write!(
                f,
                "the event table announces {announced} events but only {bytes} bytes of it are \
                 readable; no events are served"
            ),
            Self::Annotations { records } => {
                write!(
                    f,
                    "annotations of {records} records could not be read to their end"
                )
            }
        }
    }
}
