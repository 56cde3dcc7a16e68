//! The interface through which messages are delivered to any destination.

use thiserror::Error;

use crate::rosneuro_msgs::NeuroFrame;

/// Destination of messages of one type.
pub trait Sink<M>: Send {
    /// Queues a message for delivery without waiting. If a receiver is too slow, messages are
    /// dropped and counted.
    ///
    /// # Errors
    ///
    /// [`SinkError`] if the sink cannot deliver any further message.
    fn publish(&mut self, message: &M) -> Result<(), SinkError>;

    /// Number of messages dropped because a receiver was too slow.
    fn dropped(&self) -> u64;

    /// Returns whether a message published now would reach anyone. Sinks that cannot tell return
    /// true.
    fn has_receivers(&self) -> bool {
        true
    }
}

/// A sink for [`NeuroFrame`]s. The trait exists to shorten the trait object `dyn Sink<NeuroFrame>`.
pub trait FrameSink: Sink<NeuroFrame> {}

impl<S: Sink<NeuroFrame>> FrameSink for S {}

/// Why a sink cannot deliver any further message.
#[derive(Debug, Error)]
pub enum SinkError {
    /// The reader has closed its end of the output.
    #[error("the reader has closed the output")]
    Closed,
    /// The time limit expired before all queued lines were written.
    #[error("the reader does not read the output; {lines} lines are lost")]
    Stuck {
        /// Number of lines that were not written.
        lines: usize,
    },
    /// The disk of the output has no room for another line.
    #[error("the disk of the output is full; free some space, or write to another disk")]
    DiskFull,
    /// Writing to the output failed.
    #[error("the output cannot be written; check the file or the disk: {0}")]
    Output(#[from] std::io::Error),
}
