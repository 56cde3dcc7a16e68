//! What each electrode delivered, once a second.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most electrodes that a [`Quality`] may carry; as many as [`Code::saturated`](crate::Code) has
/// bits.
pub const MAX_ELECTRODES: usize = 64;

/// What each electrode delivered within one second; sent every second while streaming. Seconds are
/// counted from `Start`; one that `Stop` cuts short is not reported.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Index since `Start` of the second's first ADC sample.
    pub first_sample: u64,
    /// The filters had not settled yet: the filtered figures show their start as well.
    pub settling: bool,
    /// The electrodes, in the order of [`Capabilities::labels`](crate::Capabilities::labels).
    pub electrodes: Vec<ElectrodeQuality, MAX_ELECTRODES>,
}

/// What one electrode delivered within one second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ElectrodeQuality {
    /// RMS of the filtered steps, microvolt: what the encoder reads.
    pub rms_uv: f32,
    /// RMS of the frequency [`Capabilities::mains_hz`](crate::Capabilities::mains_hz) at the input,
    /// microvolt: no filter has seen it yet.
    pub mains_uv: f32,
    /// RMS of the same frequency left in the filtered steps, microvolt.
    pub mains_residual_uv: f32,
    /// ADC samples at the converter's rail, 0 to the ADC's rate.
    pub samples_at_rail: u16,
    /// The ADC samples differed by less than half the converter's own noise: a live one, even with
    /// its input shorted, differs by more.
    pub flat: bool,
}
