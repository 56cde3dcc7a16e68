//! From the acquisition to the encoder.

use pipeline::{Sample, Step};

use crate::{Marks, Run};

/// A sample, and the step that was due with it.
#[derive(Clone, Debug, Default)]
pub struct Taken {
    /// The run that begins with this sample, or began with one for which there was no room.
    pub begun: Option<Run>,
    /// The counts.
    pub sample: Sample,
    /// Index of the sample since the start.
    pub index: u64,
    /// The step, with its index since the start.
    pub step: Option<(u64, Step)>,
    /// Device time of the sample's DRDY edge, microseconds.
    pub drdy_us: u64,
    /// What was wrong with this sample and those since the last one that was handed on.
    pub marks: Marks,
}
