//! One time step of the encoder's input.

use crate::{CELLS, Electrodes, Plane};

/// What the acquisition makes of the ADC's samples and the encoder reads: one step at 128 Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Index of the latest ADC sample that is not later than the step, since the start.
    pub sample: u64,
    /// How much later than that sample the step stands, microseconds; 0 where the ADC's rate is a
    /// multiple of the steps'.
    pub offset_us: u16,
    /// Filtered electrodes, counts x 2^5 (Q27.5).
    pub electrodes: Electrodes,
    /// The same on the scalp grid, int8.
    pub plane: Plane,
    /// Electrodes whose int8 value was clipped (0..=61).
    pub clipped: u16,
    /// ADC channels that stood at the rail in the samples since the step before, this step's own
    /// sample included; bit = channel.
    pub saturated: u64,
    /// True while the filters have not settled since the start.
    pub settling: bool,
}

impl Step {
    /// Silence, settled.
    pub const SILENCE: Self = Self {
        sample: 0,
        offset_us: 0,
        electrodes: [0; crate::ELECTRODES],
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
