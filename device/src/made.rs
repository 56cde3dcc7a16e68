//! From the encoder to the session.

use link::Event;
use pipeline::{Code, Quality};

use crate::{AuditedWindow, FilteredChunk, Marks, RawChunk};

/// Something for the host, and where it belongs.
#[derive(Clone, Debug, Default)]
pub struct Made {
    /// Number of the run that it is of.
    pub run: u32,
    /// Its device time, microseconds.
    pub at_us: u64,
    /// What it is.
    pub what: What,
}

/// What a run makes.
#[derive(Clone, Debug, Default)]
pub enum What {
    /// Nothing yet.
    #[default]
    Nothing,
    /// A code, and what was wrong around its window; its time is that of the window's last step.
    Code(Code, Marks),
    /// What each electrode delivered within the last second, at its last sample.
    Quality(Quality),
    /// Samples, at the last one.
    Raw(RawChunk),
    /// Filtered steps, at the last one.
    Filtered(FilteredChunk),
    /// A window and its code, at the code's time.
    Audit(AuditedWindow),
    /// What happened at an input, when it happened.
    Event(Event),
}
