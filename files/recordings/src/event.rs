//! Events of a recording: rows of GDF event tables, and EDF+ annotations.

use std::fmt;

/// What an event denotes; the file format determines the variant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EventLabel {
    /// A GDF event type, such as 0x0300 = 768 for the start of a trial. Bit 15 is set in the type that
    /// denotes the end of an event.
    Type(u16),
    /// A sample of a sparsely sampled signal: GDF type 0x7fff in an event table of mode 3. Holds the
    /// digital value as 32 raw bits, which the [`crate::SampleType`] of [`Event::signal`] decodes. The
    /// file stores the value in the duration column, so the event has no duration. Tables of mode 1 have
    /// no duration column; in them type 0x7fff is an ordinary [`EventLabel::Type`].
    SparseSample(u32),
    /// Text of an EDF+ or BDF+ annotation.
    Text(String),
}

impl fmt::Display for EventLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Type(kind) => write!(f, "{kind:#06x}"),
            Self::SparseSample(_) => f.write_str("sparse sample"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// An event: a row of a GDF event table or an EDF+ annotation.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Start of the event, s after the start of the file.
    pub onset_s: f64,
    /// Duration, s; `None` if the file does not state it.
    pub duration_s: Option<f64>,
    /// Index of the signal to which the event belongs; `None` if it concerns all signals.
    pub signal: Option<u16>,
    /// GDF type, sparse sample or annotation text.
    pub label: EventLabel,
}
