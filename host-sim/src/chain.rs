//! Size and rate of the simulated chain of converters.

use ads1299::CHANNELS;

/// Number of converters in the chain.
pub const CHIPS: usize = 8;

const _: () = assert!(model::CHANNELS == CHIPS * CHANNELS);

/// Sample period of the simulated chain, ns of the chain's time: 4096 cycles of 2^21 Hz. Device
/// time does not use this period; it has the model's ADC rate.
pub(crate) const PERIOD_NS: u64 = 1_953_125;

/// Sample rate of the simulated chain in the chain's time, Hz.
pub(crate) const RATE_HZ: u64 = 512;
