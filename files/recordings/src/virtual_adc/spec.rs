//! Specification and counters of the virtual ADC.

/// Number of channels of the ADC. Channel e carries electrode e of the montage; channels without an
/// electrode are 0.
pub const CHANNELS: usize = 64;

/// Sampling rate and scale of the virtual ADC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdcSpec {
    /// Sampling rate, Hz, 1..=100,000.
    pub rate_hz: u32,
    /// Scale: uV per count, > 0.
    pub lsb_uv: f64,
}

impl AdcSpec {
    /// Returns a specification with the scale of an ADS1299 at gain 24 with a reference of 4.5 V:
    /// `2 * 4.5 V / 24 / 2^24` = 22.35 nV per count (TI data sheet SBAS499, section 9.5.1).
    pub const fn ads1299(rate_hz: u32) -> Self {
        Self {
            rate_hz,
            lsb_uv: 2.0 * 4.5e6 / 24.0 / 16_777_216.0,
        }
    }
}

/// Counts of values that the conversion could not represent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AdcCounters {
    /// Number of outputs limited to the smallest or largest count.
    pub saturated: u64,
    /// Number of NaN and infinite samples in the recording; each was replaced by the signal's last
    /// finite sample, or by 0 before the first one.
    pub not_finite: u64,
}
