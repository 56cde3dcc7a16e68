//! Results of the producer, on their way to the session.

use link::Event;
use pipeline::{Code, Quality};

use crate::audited_window::AuditedWindow;
use crate::filtered_chunk::FilteredChunk;
use crate::marks::Marks;
use crate::raw_chunk::RawChunk;

/// A result for the host, with the run and the time it belongs to.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// [`Run::number`](crate::Run::number) of the run that produced it.
    pub run: u32,
    /// Device time for the frame's header, microseconds.
    pub at_us: u64,
    /// Content, which the session turns into a message.
    pub payload: Payload,
}

impl Output {
    /// Returns true at the end of each second of a run: send `Stats` and `Timing` now.
    ///
    /// The producer counts seconds in samples and emits one [`Payload::Quality`] per second, which
    /// identifies the end. `Stats`, `Timing` and `Quality` then share one device time and one place
    /// among the codes, in every run of the same samples. With a timer of the device's clock, this
    /// time and place would differ from run to run.
    pub const fn ends_second(&self) -> bool {
        matches!(self.payload, Payload::Quality(_))
    }
}

/// Content of an [`Output`].
#[derive(Clone, Debug, Default)]
pub enum Payload {
    /// An empty slot of a queue.
    #[default]
    Nothing,
    /// A code, with the faults in its window. [`Output::at_us`] is the time of the window's last
    /// step.
    Code(Code, Marks),
    /// Signal quality of each electrode over the last second. [`Output::at_us`] is the time of the
    /// second's last sample.
    Quality(Quality),
    /// Unfiltered samples. [`Output::at_us`] is the time of the last one.
    Raw(RawChunk),
    /// Filtered steps. [`Output::at_us`] is the time of the last one.
    Filtered(FilteredChunk),
    /// A window with its code. [`Output::at_us`] is the time of the code.
    Audit(AuditedWindow),
    /// An edge at an input. [`Output::at_us`] is the time of the edge.
    Event(Event),
}
