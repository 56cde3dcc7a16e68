//! One time step: the output of the acquisition and the input of the encoder.

use model::{CELLS, ELECTRODES};

use crate::{front_end::Electrodes, plane::Plane};

/// One time step at 128 Hz: filtered and quantised electrodes, with their status: clipped values,
/// channels at the rail, settling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Index in the run, from 0, of the last ADC sample at or before the time of the step.
    pub sample: u64,
    /// Time from the ADC sample `sample` to the step, microseconds; 0 if the ADC's rate is a
    /// multiple of the step rate.
    pub offset_us: u16,
    /// Filtered electrodes, counts x 2^5 (Q27.5).
    pub electrodes: Electrodes,
    /// Quantised electrodes on the scalp grid, int8.
    pub plane: Plane,
    /// Number of electrodes whose int8 value was clipped.
    pub clipped: u16,
    /// ADC channels that were at the rail in a sample after the previous step's, up to and including
    /// this step's sample; bit n is channel n.
    pub saturated: u64,
    /// True if the filters have not settled yet after the start.
    pub settling: bool,
}

impl Step {
    /// A step of zeros with settled filters.
    pub const SILENCE: Self = Self {
        sample: 0,
        offset_us: 0,
        electrodes: [0; ELECTRODES],
        plane: [0; CELLS],
        clipped: 0,
        saturated: 0,
        settling: false,
    };
}

impl Default for Step {
    fn default() -> Self {
        Self::SILENCE
    }
}
