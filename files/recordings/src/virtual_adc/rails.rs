//! Range of the ADC.

use std::ops::RangeInclusive;

/// Smallest and largest output of a 24-bit ADC, counts.
pub(super) const RAILS: RangeInclusive<f64> = -8_388_608.0..=8_388_607.0;
