//! Events of a recording: GDF event tables and EDF+ annotations.

/// Identification of an event; its form depends on the file format.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EventLabel {
    /// A GDF event type, such as 0x0300 = 768 for the start of a trial. Bit 15 marks the end of the
    /// event.
    Type(u16),
    /// A sample of a sparsely sampled signal: GDF type 0x7fff in an event table of mode 3. Holds
    /// the digital value as 32 raw bits, which the [`crate::SampleType`] of [`Event::signal`]
    /// decodes. The event has no duration, because the value is stored in the table's duration
    /// column. Tables of mode 1 have no such column; there, type 0x7fff is an ordinary
    /// [`EventLabel::Type`].
    SparseSample(u32),
    /// Text of an EDF+ or BDF+ annotation.
    Text(String),
}

/// One event: a GDF event table row or an EDF+ annotation.
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
