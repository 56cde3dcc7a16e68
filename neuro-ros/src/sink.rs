//! Where messages go.

use thiserror::Error;

use crate::NeuroFrame;

/// Where messages of one kind go.
pub trait Sink<M>: Send {
    /// Deliver a message. Never waits: what a slow receiver does not take is dropped and counted.
    ///
    /// # Errors
    ///
    /// [`SinkError`] if nothing can be delivered any more, now or later.
    fn publish(&mut self, message: &M) -> Result<(), SinkError>;

    /// Messages that a receiver did not get because it was slow.
    fn dropped(&self) -> u64;
}

/// Where NeuroFrames go.
pub trait FrameSink: Sink<NeuroFrame> {}

impl<S: Sink<NeuroFrame>> FrameSink for S {}

/// A sink has ended for good.
#[derive(Debug, Error)]
pub enum SinkError {
    /// Whoever read the lines has gone.
    #[error("the reader of the output has gone")]
    Closed,
    /// Whoever reads the lines takes none.
    #[error("the reader of the output does not read; {lines} lines are lost")]
    Stuck {
        /// Lines that were not written.
        lines: usize,
    },
    /// The output cannot be written.
    #[error("the output cannot be written; check the file or the disk: {0}")]
    Output(#[from] std::io::Error),
}
