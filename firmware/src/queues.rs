//! Queues between the tasks: what their slots hold, and their ends.

use device::{AcquiredSample, Output};
use embassy_sync::{
    blocking_mutex::raw::CriticalSectionRawMutex,
    zerocopy_channel::{Receiver, Sender},
};

/// Guards everything that tasks of different priorities share. It disables interrupts.
pub type RawMutex = CriticalSectionRawMutex;

/// Slot of the queue from the acquisition to the encoder.
#[derive(Clone, Debug, Default)]
pub struct SampleSlot {
    /// Sample, and its step if one is due.
    pub acquired: AcquiredSample,
    /// DRDY edge of the sample, in ticks of the board's [`Clock`](crate::Clock).
    pub drdy_ticks: u32,
}

/// Slot of the queue from the encoder to the conversation.
#[derive(Clone, Debug, Default)]
pub struct OutputSlot {
    /// Code, report or chunk for the host.
    pub output: Output,
    /// Time at which the encoder queued the output, in ticks of the board's [`Clock`](crate::Clock).
    pub queued_ticks: u32,
}

/// End of the sample queue that [`acquire`](fn@crate::acquire) holds.
pub type SampleSender = Sender<'static, RawMutex, SampleSlot>;
/// End of the sample queue that [`encode`](fn@crate::encode) holds.
pub type SampleReceiver = Receiver<'static, RawMutex, SampleSlot>;
/// End of the output queue that [`encode`](fn@crate::encode) holds.
pub type OutputSender = Sender<'static, RawMutex, OutputSlot>;
/// End of the output queue that [`converse`](fn@crate::converse) holds.
pub type OutputReceiver = Receiver<'static, RawMutex, OutputSlot>;
