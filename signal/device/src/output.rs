//! Results that the producer passes to the session.

use link::Event;
use pipeline::{Code, PackedCode, Quality};

use crate::acquired_sample::Marks;
use crate::audited_window::AuditedWindow;
use crate::chunk::{CompressedChunk, FilteredChunk, RawChunk};

/// A result for the host, with the number of its run and the time for its frame. It borrows its
/// content from the producer: the receiver sends it, or copies it into a queue, before it returns.
#[derive(Clone, Copy, Debug)]
pub struct Output<'p> {
    /// [`Run::number`](crate::Run::number) of the run that produced this output.
    pub run: u32,
    /// Device time for the frame's header, microseconds.
    pub at_us: u64,
    /// Content, which the session turns into a message.
    pub payload: Payload<'p>,
}

impl Output<'_> {
    /// Returns true at the end of each second of a run: send `Stats` and `Timing` now.
    ///
    /// The producer counts seconds in samples and emits one [`Payload::Quality`] at the end of each
    /// second. `Stats`, `Timing` and `Quality` of a second therefore have the same device time, and
    /// the same samples always put them between the same codes. A timer of the device's clock would
    /// put them at varying places.
    pub const fn ends_second(&self) -> bool {
        matches!(self.payload, Payload::Quality(_))
    }
}

/// Content of an [`Output`].
#[derive(Clone, Copy, Debug)]
pub enum Payload<'p> {
    /// A code, with the faults in its window. [`Output::at_us`] is the time of the window's last
    /// step.
    Code(&'p Code, Marks),
    /// A block of the packed code, with the faults in it. [`Output::at_us`] is the time of the
    /// block's last step.
    PackedCode(&'p PackedCode, Marks),
    /// An edge at the trigger input. [`Output::at_us`] is the time of the edge.
    Event(Event),
    /// Signal quality of each electrode over the last second. [`Output::at_us`] is the time of the
    /// second's last sample.
    Quality(&'p Quality),
    /// Unfiltered samples. [`Output::at_us`] is the time of the last sample.
    Raw(&'p RawChunk),
    /// Unfiltered samples, compressed. [`Output::at_us`] is the time of the last sample.
    CompressedRaw(&'p CompressedChunk),
    /// Filtered steps. [`Output::at_us`] is the time of the last step.
    Filtered(&'p FilteredChunk),
    /// The planes of a window, with its code if the device has the network. [`Output::at_us`] is
    /// the time of the window's last step.
    Audit(&'p AuditedWindow),
}
