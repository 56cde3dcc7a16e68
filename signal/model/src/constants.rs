//! The generated constants (rates, scales, dimensions, and the kernel of the second convolution),
//! and the types of the generated filters and code format.

use fixed_dsp::Cascade;
use int8_nn::{Pair, PlaneShape};

include!(concat!(env!("OUT_DIR"), "/constants.rs"));

/// Filters for one mains frequency, with the delays of filters, resampler and window.
#[derive(Clone, Copy, Debug)]
pub struct MainsFilter {
    /// Mains frequency that the notch removes, Hz.
    pub mains_hz: u8,
    /// Sections in signal order; samples are counts in Q27.5.
    pub cascade: Cascade<SECTIONS>,
    /// Group delay of the filter sections and the resampler at 10 Hz, microseconds.
    pub group_delay_us: u32,
    /// Group delay plus [`WINDOW_CENTRE_US`](crate::WINDOW_CENTRE_US). A code's device time minus
    /// this delay is the time at which the signal in the middle of the code's window was at the
    /// electrodes.
    pub scalp_delay_us: u32,
    /// Number of ADC samples after which the response to an input step stays below 1e-4 of the
    /// step, at the output of the resampler.
    pub settling_samples: u32,
    /// Description of the filters for human readers, stored in the `prefiltering` fields of
    /// recordings.
    pub description: &'static str,
}

/// Integer format of a code that a device can produce. `link::CodeFormat` is the format's byte on
/// the wire, which can also be a format that this release does not know. A level is dequantised as
/// `z = (level - CODE_ZERO_POINT) * CODE_SCALE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CodeFormat {
    /// Levels of 8 bits. The scale covers twice the calibrated range.
    Int8,
    /// Values of 8 bits, and one exponent, 0..=8, for the whole code: a level is `value *
    /// 2^exponent`. The scale is the same as in [`CodeFormat::Int16`]; the zero point is 0.
    Int8Exponent,
    /// Levels of 16 bits. The scale covers 16 times the calibrated range; the zero point is 0.
    Int16,
}

impl CodeFormat {
    /// Returns the size of a code in bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Int8 => CODE,
            Self::Int8Exponent => 1 + CODE,
            Self::Int16 => 2 * CODE,
        }
    }
}
