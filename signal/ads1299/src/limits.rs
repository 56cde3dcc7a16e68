//! Limits that the self-test applies to each channel.

use core::fmt;

use crate::settings::{Gain, Rate};

/// Largest |gain error|, as a fraction: the sum of 2 % for the amplitude of the test signal
/// (assumed, not verified against the data sheet) and 1 % for the amplifier (typical gain error 0.1
/// % of full scale, data sheet section 7.5).
const GAIN_ERROR: f32 = 0.03;

/// Largest |offset|, in microvolts at the input: five times a typical offset of 60 uV (assumed, not
/// verified against the data sheet).
const OFFSET_UV: f32 = 300.0;

/// Least number of samples for a valid result.
const SAMPLES: u32 = 100;

/// Limit of the self-test that a channel violates, with the measured value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SelfTestFault {
    /// There are too few samples for a valid result.
    Samples {
        /// Number of samples that were measured.
        measured: u32,
        /// Least number of samples for a valid result.
        limit: u32,
    },
    /// The test signal has a wrong amplitude.
    Gain {
        /// Ratio of the measured to the expected amplitude, minus 1; -1 without any signal.
        measured: f32,
        /// Largest |gain error|, as a fraction.
        limit: f32,
    },
    /// The offset is out of range.
    Offset {
        /// Measured offset, in microvolts at the input.
        measured: f32,
        /// Largest |offset|, in microvolts at the input.
        limit: f32,
    },
    /// The channel has too much noise.
    Noisy {
        /// Measured noise, in microvolts rms at the input.
        measured: f32,
        /// Largest noise, in microvolts rms at the input.
        limit: f32,
    },
    /// The channel has too little noise, so it is dead.
    Silent {
        /// Measured noise, in microvolts rms at the input.
        measured: f32,
        /// Least noise, in microvolts rms at the input.
        limit: f32,
    },
}

/// Typical noise of a channel with shorted input, in microvolts rms at the input.
///
/// The values at gain 1, by rate, are taken from the data sheet's table 1 (section 8.1). The
/// table's values at gain 2 are 0.53 times the values at gain 1 (0.50 times at 16 kHz). At gain 24
/// the data sheet's front page states 1 uV peak to peak in 70 Hz. With a peak-to-peak value of 6.6
/// times the rms, that is 0.14 times the noise at gain 1 and 250 Hz. The gains in between follow
/// `sqrt(1 / gain^2 + 0.13^2)`, which matches the factors at gains 2 and 24.
pub const fn typical_noise_uv(gain: Gain, rate: Rate) -> f32 {
    let at_gain_one = [21.70, 6.93, 4.33, 3.06, 2.17, 1.53, 1.08][rate as usize];
    let of_gain = [1.0, 0.53, 0.282, 0.211, 0.180, 0.154, 0.137][gain as usize];
    at_gain_one * of_gain
}

/// Checks that there are enough samples for a valid result.
pub(crate) fn check_samples(measured: u32) -> Result<(), SelfTestFault> {
    let limit = SAMPLES;
    within(measured >= limit, SelfTestFault::Samples { measured, limit })
}

/// Checks a gain error, a fraction, against [`GAIN_ERROR`].
pub(crate) fn check_gain(measured: f32) -> Result<(), SelfTestFault> {
    let limit = GAIN_ERROR;
    within(measured.abs() <= limit, SelfTestFault::Gain { measured, limit })
}

/// Checks an offset, in microvolts at the input, against [`OFFSET_UV`].
pub(crate) fn check_offset(measured: f32) -> Result<(), SelfTestFault> {
    let limit = OFFSET_UV;
    within(measured.abs() <= limit, SelfTestFault::Offset { measured, limit })
}

/// Checks a channel's noise, in microvolts rms at the input: it must be half to twice
/// [`typical_noise_uv`]. A channel without noise is dead.
pub(crate) fn check_noise(measured: f32, gain: Gain, rate: Rate) -> Result<(), SelfTestFault> {
    let typical = typical_noise_uv(gain, rate);
    let limit = typical / 2.0;
    within(measured >= limit, SelfTestFault::Silent { measured, limit })?;
    let limit = typical * 2.0;
    within(measured <= limit, SelfTestFault::Noisy { measured, limit })
}

fn within(holds: bool, fault: SelfTestFault) -> Result<(), SelfTestFault> {
    if holds { Ok(()) } else { Err(fault) }
}

impl fmt::Display for SelfTestFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples { measured, limit } => write!(
                formatter,
                "{measured} samples are too few to judge by, {limit} are wanted; is there a test \
                 signal, and does it run long enough?"
            ),
            Self::Gain { measured, limit } => write!(
                formatter,
                "gain off by {} %, {} % allowed; check the gain set and AVDD (the test signal follows the reference, so a \
                 wrong reference does not show here)",
                Decimal(measured * 100.0, 2),
                Decimal(limit * 100.0, 1)
            ),
            Self::Offset { measured, limit } => write!(
                formatter,
                "offset of {} uV, {} uV allowed; check the analogue supplies",
                Decimal(*measured, 1),
                Decimal(*limit, 0)
            ),
            Self::Noisy { measured, limit } => write!(
                formatter,
                "noise of {} uV rms, {} uV allowed; check supplies, reference, and what runs beside them",
                Decimal(*measured, 3),
                Decimal(*limit, 3)
            ),
            Self::Silent { measured, limit } => write!(
                formatter,
                "noise of {} uV rms, at least {} uV are in every channel; the channel is dead or off",
                Decimal(*measured, 3),
                Decimal(*limit, 3)
            ),
        }
    }
}

impl core::error::Error for SelfTestFault {}

/// Formats the number `.0` with `.1` decimal places, rounded. Uses integer formatting only, because
/// the standard library's float formatting takes 15 KB of a microcontroller's flash.
struct Decimal(f32, u32);

impl fmt::Display for Decimal {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss,
        reason = "it saturates; a few digits are shown"
    )]
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value, places) = *self;
        let unit = 10_u32.pow(places);
        let units = (value.abs() * unit as f32 + 0.5) as u32;
        if value < 0.0 && units > 0 {
            formatter.write_str("-")?;
        }
        write!(formatter, "{}", units / unit)?;
        if places > 0 {
            let width = places as usize;
            write!(formatter, ".{:0width$}", units % unit)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::format;

    use super::*;

    #[test]
    fn a_number_looks_as_the_standard_library_shows_it() {
        for value in [0.0, 0.04, 0.05, 0.27, -0.04, -0.06, -1.0, 9.96, 59.94, -312.5, 187_500.0] {
            assert_eq!(format!("{}", Decimal(value, 3)), format!("{value:.3}"));
        }
        assert_eq!(format!("{}", Decimal(-100.0, 2)), "-100.00");
        assert_eq!(format!("{}", Decimal(299.6, 0)), "300");
        assert_eq!(format!("{}", Decimal(-0.01, 1)), "0.0");
        assert_eq!(format!("{}", Decimal(f32::NAN, 1)), "0.0");
    }
}
