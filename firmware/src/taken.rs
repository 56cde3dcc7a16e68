//! From the acquisition to the encoder.

use device::{Marks, Run};
use pipeline::{Sample, Step};

/// A sample, and the step that was due with it.
#[derive(Clone, Debug, Default)]
pub struct Taken {
    /// The run that begins with this sample, or began with one for which there was no room.
    pub begun: Option<Run>,
    /// The counts.
    pub sample: Sample,
    /// The step, with its index since the start.
    pub step: Option<(u64, Step)>,
    /// Device time of the sample's DRDY edge, microseconds.
    pub drdy_us: u64,
    /// The same edge on the board's clock, ticks.
    pub drdy_ticks: u32,
    /// What was wrong with this sample and those since the last one that was handed on.
    pub marks: Marks,
}
