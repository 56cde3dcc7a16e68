//! What goes from task to task, with the board's own time.

use device::{AcquiredSample, Output};

/// From the acquisition to the encoder.
#[derive(Clone, Debug, Default)]
pub struct Stamped {
    /// A sample, and its step.
    pub taken: AcquiredSample,
    /// The sample's DRDY edge on the board's [`Clock`](crate::Clock), ticks.
    pub drdy_ticks: u32,
}

/// From the encoder to the conversation.
#[derive(Clone, Debug, Default)]
pub struct Handed {
    /// Something for the host.
    pub made: Output,
    /// When it was handed on, on the board's [`Clock`](crate::Clock), ticks.
    pub ticks: u32,
}
