//! Queues between the tasks: what their slots hold, and their ends.

use device::{AcquiredSample, Output};
use embassy_sync::{
    blocking_mutex::raw::CriticalSectionRawMutex,
    zerocopy_channel::{Receiver, Sender},
};

/// Mutex that guards everything that tasks of different priorities share. Locking it disables
/// interrupts.
pub type RawMutex = CriticalSectionRawMutex;

/// Slot of the queue from the acquisition to the encoder.
#[derive(Clone, Debug, Default)]
pub struct SampleSlot {
    /// Sample, and its step if one is due.
    pub acquired: AcquiredSample,
    /// Time of the sample's DRDY edge, in ticks of the board's [`Clock`](crate::Clock).
    pub drdy_ticks: u32,
}

/// Slot of the queue from the encoder to the conversation.
#[derive(Clone, Debug, Default)]
pub struct OutputSlot {
    /// Output for the host, for example a code or a report.
    pub output: Output,
    /// Time at which the encoder queued the output, in ticks of the board's [`Clock`](crate::Clock).
    pub queued_ticks: u32,
}

/// Sending end of the sample queue, which [`acquire`](fn@crate::acquire) holds.
pub type SampleSender = Sender<'static, RawMutex, SampleSlot>;
/// Receiving end of the sample queue, which [`encode`](fn@crate::encode) holds.
pub type SampleReceiver = Receiver<'static, RawMutex, SampleSlot>;
/// Sending end of the output queue, which [`encode`](fn@crate::encode) holds.
pub type OutputSender = Sender<'static, RawMutex, OutputSlot>;
/// Receiving end of the output queue, which [`converse`](fn@crate::converse) holds.
pub type OutputReceiver = Receiver<'static, RawMutex, OutputSlot>;
