//! The filters for one mains frequency.

use fixed_dsp::Cascade;

use crate::constants::SECTIONS;

/// Filters before the resampler for one mains frequency, with the delays of filters, resampler and
/// window.
#[derive(Clone, Copy, Debug)]
pub struct MainsFilter {
    /// Mains frequency that the notch removes, Hz.
    pub mains_hz: u8,
    /// Sections in signal order; samples are counts in Q27.5.
    pub cascade: Cascade<SECTIONS>,
    /// Group delay of sections and resampler at 10 Hz, microseconds.
    pub group_delay_us: u32,
    /// Group delay plus [`WINDOW_CENTRE_US`](crate::WINDOW_CENTRE_US). A code's device time minus
    /// this delay is the time at which the signal in the middle of the code's window was at the
    /// electrodes.
    pub scalp_delay_us: u32,
    /// Number of ADC samples after which the response to an input step stays below 1e-4 of the
    /// step, at the output of the resampler.
    pub settling_samples: u32,
    /// Description of the filters in words, which recordings store in their `prefiltering` fields.
    pub description: &'static str,
}
