//! One time step: the output of the acquisition and the input of the encoder.

use model::{CELLS, ELECTRODES};

use crate::{front_end::Electrodes, plane::Plane};

/// One time step at 128 Hz: filtered and quantised electrodes, with events since the step before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Index, since the start, of the last ADC sample that is not later than the step.
    pub sample: u64,
    /// Time from the ADC sample `sample` to the step, microseconds; 0 if the ADC's rate is a
    /// multiple of the step rate.
    pub offset_us: u16,
    /// Filtered electrodes, counts x 2^5 (Q27.5).
    pub electrodes: Electrodes,
    /// Quantised electrodes on the scalp grid, int8.
    pub plane: Plane,
    /// Number of electrodes whose int8 value was clipped (0..=61).
    pub clipped: u16,
    /// ADC channels that were at the rail in a sample since the step before, including this step's
    /// sample; bit = channel.
    pub saturated: u64,
    /// True until the filters have settled after the start.
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
