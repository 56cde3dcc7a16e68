//! Events: what a recording says happened, and when.

/// What kind of event it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EventLabel {
    /// A GDF event type (0x0300 = 768 is the start of a trial; bit 15 set = the end of it).
    Type(u16),
    /// A sample of a signal that is sampled sparsely (GDF type 0x7fff in a table of mode 3): its
    /// digital value, the 32 bits that the table holds, to be read as the
    /// [`crate::SampleType`] of [`Event::signal`]. The event has no duration: the value lies in
    /// its place. A table of mode 1 has no room for it; there the type stays a type.
    SparseSample(u32),
    /// An EDF+ annotation.
    Text(String),
}

/// One event.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Time of the event, s after the start of the file.
    pub onset_s: f64,
    /// Its length, s; `None` when the file gives none.
    pub duration_s: Option<f64>,
    /// Index of the signal that it belongs to; `None` = all of them.
    pub signal: Option<u16>,
    /// What happened.
    pub label: EventLabel,
}
