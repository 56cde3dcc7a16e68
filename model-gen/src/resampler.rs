//! From the ADC's rate to that of the steps: design and quantisation of the taps.

use std::f64::consts::PI;

use artifact::Decimation;
use fixed_dsp::Resampler;
use num_complex::Complex64;

use crate::{FilterError, fir::kaiser_low_pass, integer_model::ELECTRODES};

/// One in a tap's format, Q2.30.
pub const UNITY: i32 = Resampler::<1, 1>::UNITY;

/// -6 dB point of the low-pass, Hz, and shape of its Kaiser window: at least 54 dB above 78 Hz,
/// whose image is 50 Hz, for 0.1 dB at 50 Hz. docs/decisions/0007-alias-free-decimation.md has the
/// table that this was picked from.
pub const CUTOFF_HZ: f64 = 62.0;
/// See [`CUTOFF_HZ`].
pub const KAISER_BETA: f64 = 5.0;

/// The low-pass looks back over an eighth of a second, rounded up to four samples.
const SPANS_PER_SECOND: u32 = 8;
/// What the taps of a phase come in: the unrolled loop takes four at a time.
const TAPS_AT_ONCE: u32 = 4;

/// Room for what the electrodes remember, and again for the table of taps: half of the RAM of the
/// smallest board, an eighth of its flash (STM32F446, datasheet DS10693: 128 and 512 KiB).
const LARGEST_BYTES: usize = 65_536;

/// A resampler's numbers: output rate = input rate * phases / `down`, in lowest terms.
///
/// What [`Resampler`] holds, in sizes that are known only when the artifact is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResamplerTable {
    /// Input samples per as many outputs as there are phases.
    pub down: u16,
    /// Impulse response, Q2.30, `[phase][age]`, the newest input sample first. Every phase sums to
    /// exactly [`UNITY`], so that a constant passes each of them unchanged.
    pub taps: Vec<Vec<i32>>,
}

impl ResamplerTable {
    /// The resampler from `rate_hz` to `step_rate_hz`.
    ///
    /// # Errors
    /// When the rates do not allow this decimation, or its numbers would take too much memory.
    pub fn new(
        decimation: Decimation,
        rate_hz: u32,
        step_rate_hz: u32,
    ) -> Result<Self, FilterError> {
        let common = greatest_common_divisor(rate_hz, step_rate_hz);
        if step_rate_hz == 0 || rate_hz < step_rate_hz {
            return Err(FilterError::BelowStepRate {
                rate_hz,
                step_rate_hz,
            });
        }
        let down = u16::try_from(rate_hz / common).map_err(|_| FilterError::RateTerms {
            rate_hz,
            step_rate_hz,
        })?;
        let phases = step_rate_hz / common;
        let taps = match decimation {
            Decimation::Literal if phases == 1 => vec![vec![UNITY]],
            Decimation::Literal => {
                return Err(FilterError::LiteralRate {
                    rate_hz,
                    step_rate_hz,
                    nearest_hz: (rate_hz + step_rate_hz / 2) / step_rate_hz * step_rate_hz,
                });
            }
            Decimation::Fir => low_pass(rate_hz, phases as usize)?,
        };
        let table = Self { down, taps };
        table.prove_accumulator(rate_hz)?;
        Ok(table)
    }

    /// Outputs per [`down`](Self::down) input samples.
    pub fn phases(&self) -> usize {
        self.taps.len()
    }

    /// Input samples that make an output.
    pub fn taps_per_phase(&self) -> usize {
        self.taps[0].len()
    }

    /// The largest accumulator that samples of 32 bits can make, rounding included, as a part of
    /// 2^63.
    pub fn largest_accumulator(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a magnitude has 31 bits")]
        let sum = self.largest_magnitude() as f64 * 2.0_f64.powi(31);
        (sum + f64::from(UNITY / 2)) / 2.0_f64.powi(63)
    }

    /// Sum of the magnitudes of the taps of the phase that has most, Q2.30: below 2^31, which
    /// leaves half of a 64-bit accumulator.
    pub fn largest_magnitude(&self) -> u64 {
        let magnitude =
            |taps: &Vec<i32>| -> u64 { taps.iter().map(|tap| u64::from(tap.unsigned_abs())).sum() };
        self.taps.iter().map(magnitude).max().unwrap_or(0)
    }

    /// The taps of each phase as numbers; each phase sums to 1.
    pub fn phase_responses(&self) -> impl Iterator<Item = Vec<f64>> {
        let real = |tap: &i32| f64::from(*tap) / f64::from(UNITY);
        self.taps
            .iter()
            .map(move |phase| phase.iter().map(real).collect())
    }

    /// The impulse response at `phases` times the input rate, as quantised; its sum is 1.
    pub fn prototype(&self) -> Vec<f64> {
        let phases: Vec<Vec<f64>> = self.phase_responses().collect();
        let share = 1.0 / real(phases.len());
        (0..self.taps_per_phase())
            .flat_map(|age| phases.iter().map(move |phase| phase[age] * share))
            .collect()
    }

    /// Complex gain at `frequency_hz` of samples at `rate_hz`, from a sample to the time at which an
    /// output stands: the prototype's response, the mean over the phases.
    ///
    /// A frequency above half of the outputs' rate comes out with this gain where it folds; the gain
    /// at `k * rate_hz - f` is that of the image which a tone of `f` leaves where the rates are no
    /// multiples.
    pub fn frequency_response(&self, frequency_hz: f64, rate_hz: f64) -> Complex64 {
        let turn = -2.0 * PI * frequency_hz / (rate_hz * real(self.phases()));
        self.prototype()
            .iter()
            .enumerate()
            .map(|(index, tap)| Complex64::from_polar(*tap, turn * real(index)))
            .sum()
    }

    fn prove_accumulator(&self, rate_hz: u32) -> Result<(), FilterError> {
        let magnitude = self.largest_magnitude();
        if magnitude < 1 << 31 {
            return Ok(());
        }
        Err(FilterError::ResamplerAccumulator { rate_hz, magnitude })
    }
}

/// The alias-free low-pass in phases, each normalised to a gain of 1 and quantised.
fn low_pass(rate_hz: u32, phases: usize) -> Result<Vec<Vec<i32>>, FilterError> {
    let taps = rate_hz
        .div_ceil(SPANS_PER_SECOND)
        .next_multiple_of(TAPS_AT_ONCE) as usize;
    for (what, words) in [
        ("what 61 electrodes remember", ELECTRODES * taps),
        ("the table of taps", phases * taps),
    ] {
        let bytes = words * size_of::<i32>();
        if bytes > LARGEST_BYTES {
            return Err(FilterError::ResamplerSize {
                what,
                rate_hz,
                phases,
                taps,
                bytes,
                largest: LARGEST_BYTES,
            });
        }
    }
    let prototype = kaiser_low_pass(
        phases * taps,
        CUTOFF_HZ,
        KAISER_BETA,
        f64::from(rate_hz) * real(phases),
    );
    Ok((0..phases)
        .map(|phase| quantise(prototype.iter().skip(phase).step_by(phases)))
        .collect())
}

/// A phase's taps in Q2.30 with the sum [`UNITY`]; the largest tap takes what rounding leaves.
fn quantise<'a>(taps: impl Iterator<Item = &'a f64> + Clone) -> Vec<i32> {
    let scale = f64::from(UNITY) / taps.clone().sum::<f64>();
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a tap is about the cutoff over half the rate at most: below 2"
    )]
    let mut quantised: Vec<i32> = taps.map(|tap| (tap * scale).round() as i32).collect();
    // The rest is small, so it is right even where a partial sum wraps.
    let sum = quantised.iter().copied().fold(0, i32::wrapping_add);
    if let Some(largest) = quantised.iter_mut().max_by_key(|tap| tap.unsigned_abs()) {
        *largest = largest.wrapping_add(UNITY.wrapping_sub(sum));
    }
    quantised
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 {
        a
    } else {
        greatest_common_divisor(b, a % b)
    }
}

#[expect(clippy::cast_precision_loss, reason = "a table has thousands of taps")]
fn real(count: usize) -> f64 {
    count as f64
}
