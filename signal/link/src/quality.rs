//! Signal quality of the electrodes, once a second.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Largest number of electrodes in a [`Quality`]; equals the number of bits of
/// [`Code::saturated`](crate::Code::saturated).
pub const MAX_ELECTRODES: usize = 64;

/// Signal quality of each electrode over one second; sent every second while streaming.
///
/// Seconds are counted from `Start`; a second that `Stop` interrupts is not reported.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Index since `Start` of the second's first ADC sample.
    pub first_sample: u64,
    /// True if the filters had not settled: `rms_uv` and `mains_residual_uv` then include the
    /// filters' transient.
    pub settling: bool,
    /// One entry per electrode, in the order of
    /// [`Capabilities::labels`](crate::Capabilities::labels).
    pub electrodes: Vec<ElectrodeQuality, MAX_ELECTRODES>,
}

/// Signal quality of one electrode over one second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ElectrodeQuality {
    /// RMS of the filtered steps that the encoder reads, microvolt.
    pub rms_uv: f32,
    /// RMS of the mains frequency ([`Capabilities::mains_hz`](crate::Capabilities::mains_hz)) at the
    /// input, before any filter, microvolt.
    pub mains_uv: f32,
    /// RMS of the mains frequency that is left in the filtered steps, microvolt.
    pub mains_residual_uv: f32,
    /// Number of ADC samples at the converter's rail, at most the number of samples in a second.
    pub samples_at_rail: u16,
    /// True if the peak-to-peak range of the ADC samples was less than half the converter's own
    /// noise. A working converter has a larger range, even with its input shorted.
    pub flat: bool,
}
