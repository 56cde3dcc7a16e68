//! Size and rate of the simulated chain of converters.

use ads1299::CHANNELS;

/// Number of converters in the chain.
pub const CHIPS: usize = 8;

const _: () = assert!(model::CHANNELS == CHIPS * CHANNELS);

/// Time from one sample to the next on the chain's clock, ns: 4096 cycles of 2^21 Hz. The model's
/// ADC rate does not depend on this period, because that rate belongs to the device's clock.
pub(crate) const PERIOD_NS: u64 = 1_953_125;

/// Samples per second of the chain's clock, Hz.
pub(crate) const RATE_HZ: u64 = 512;
