//! Band power of several signals, as logarithms in one byte each.

use crate::{
    cascade::{Cascade, CascadeState},
    coefficient::Coefficient,
    section::Section,
};

/// Number of second-order sections of the band-pass, a Butterworth filter of order 2 at each edge.
pub const BAND_SECTIONS: usize = 2;

/// Number of levels for each doubling of a power: one level is 0.376 dB.
pub const LEVELS_PER_OCTAVE: u32 = 8;
/// Level of a power of 1 before saturation to 0..=255. Level 0 stands for a power of 2^10 or less,
/// level 255 for a power of 2^41.9 or more.
pub const LEVEL_OF_ONE: i32 = -80;

/// Section `y0 = gain (x0 - x2) + a1 y1 + a2 y2` of a band-pass. It is the same as
/// [`Section::BandPass`], but a program that uses only this type contains no code for other
/// sections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BandPass {
    /// Factor of the input term `x0 - x2`.
    pub gain: Coefficient,
    /// Factor of the previous output, `y1`.
    pub a1: Coefficient,
    /// Factor of `y2`, the output two samples earlier.
    pub a2: Coefficient,
}

impl BandPass {
    /// Creates a section from gain, a1 and a2, Q32; each magnitude must be below 2^62.
    pub const fn from_q32([gain, a1, a2]: [i64; 3]) -> Self {
        Self {
            gain: Coefficient::from_q32(gain),
            a1: Coefficient::from_q32(a1),
            a2: Coefficient::from_q32(a2),
        }
    }
}

/// Filter states and energies of `N` signals, which share one band-pass.
///
/// The energies cover the samples since the last call of [`Self::take_levels`]. The execution time
/// of a call does not depend on the samples.
#[derive(Clone, Debug)]
pub struct BandPower<const N: usize> {
    states: [CascadeState<BAND_SECTIONS>; N],
    /// Sum of the squares of each signal's filtered samples; wraps.
    energies: [u64; N],
}

impl<const N: usize> BandPower<N> {
    /// State after a long silence.
    pub const REST: Self = Self { states: [CascadeState::REST; N], energies: [0; N] };

    /// Filters `B` consecutive samples of the first `signals` signals, and adds the squares of the
    /// filtered samples to the energies. The block length affects only the number of instructions,
    /// not the levels.
    ///
    /// Overflow wraps: see [`Cascade`].
    #[inline]
    pub fn add_block<const B: usize>(
        &mut self,
        band: &[BandPass; BAND_SECTIONS],
        samples: &[[i32; N]; B],
        signals: usize,
    ) {
        let band = Cascade {
            sections: band.map(|BandPass { gain, a1, a2 }| Section::BandPass { gain, a1, a2 }),
        };
        let fractions = band.fractions();
        let states = self.states.iter_mut().zip(&mut self.energies);
        for (signal, (state, energy)) in states.enumerate().take(signals) {
            // `samples.map` would copy all signals of each sample, instead of only this one.
            let block: [i32; B] =
                core::array::from_fn(|at| samples[at].get(signal).copied().unwrap_or_default());
            for y in band.apply_block(&fractions, state, block) {
                let y = i64::from(y);
                *energy = energy.wrapping_add(y.wrapping_mul(y).cast_unsigned());
            }
        }
    }

    /// Returns the [`level`] of the energy of the first `signals` signals, and 0 for the others.
    /// Sets the energies to 0.
    #[inline]
    pub fn take_levels(&mut self, signals: usize) -> [u8; N] {
        let mut levels = [0; N];
        for (level, energy) in levels.iter_mut().zip(&self.energies).take(signals) {
            *level = self::level(*energy);
        }
        self.energies = [0; N];
        levels
    }
}

/// Lower ends of the levels within an octave: 2^31 * 2^((n + 1/2) / 8), rounded up.
const THRESHOLDS: [u32; LEVELS_PER_OCTAVE as usize] = [
    2_242_560_872,
    2_445_529_972,
    2_666_869_345,
    2_908_241_643,
    3_171_460_000,
    3_458_501_654,
    3_771_522_797,
    4_112_874_774,
];

/// Returns `8 log2(power) - 80`, rounded, saturated to 0..=255; 0 for a power of 0.
#[inline]
#[expect(
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "an exponent below 64, and a clamped level"
)]
pub fn level(power: u64) -> u8 {
    let power = power.max(1);
    let exponent = power.ilog2();
    // The mantissa, in [2^31, 2^32), is truncated. If a power exceeds the lower end of a level by a
    // factor below 1 + 2^-31, the result can therefore be the level below.
    let mantissa = (power << (63 - exponent) >> 32) as u32;
    let above = THRESHOLDS.iter().map(|end| u32::from(mantissa >= *end));
    let eighths = exponent * LEVELS_PER_OCTAVE + above.sum::<u32>();
    (eighths as i32 + LEVEL_OF_ONE).clamp(0, 255) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_the_rounded_logarithm_of_the_power() {
        for exponent in 0..64 {
            for mantissa in 0..1_000_u64 {
                let power = (1_u64 << exponent) + ((1_u64 << exponent) / 1_000) * mantissa;
                #[expect(clippy::cast_precision_loss, reason = "the reference is rounded")]
                let exact = (8.0 * (power as f64).log2() - 80.0).clamp(0.0, 255.0);
                let error = f64::from(level(power)) - exact;
                assert!(error.abs() <= 0.500_001, "{power}: {error}");
            }
        }
        assert_eq!(level(0), 0);
        assert_eq!(level(u64::MAX), 255);
    }

    #[test]
    fn each_signal_has_its_own_energy_and_a_new_part_starts_at_zero() {
        // y0 = x0 - x2: twice the input at a quarter of the sampling rate, nothing at DC.
        let band = [BandPass::from_q32([1 << 32, 0, 0]); 2];
        let mut powers = BandPower::REST;
        let alternating = [1_000, 0, -1_000, 0];
        for n in 0..8 {
            powers.add_block(&band, &[[alternating[n % 4], 1_000]], 2);
        }
        // Outputs of the first signal: 1000, 0, -3000, 0, and then 4000 and -4000.
        let expected = [1_000_u64, 3_000, 4_000, 4_000].map(|y| y * y).iter().sum();
        // Outputs of the second signal, a step: 1000, 1000, -1000, -1000 and then zeros.
        assert_eq!(powers.take_levels(2), [level(expected), level(4_000_000)]);
        assert_eq!(powers.take_levels(2), [0, 0]);
    }
}
