//! Designs and quantises the resampler from the ADC's rate to the step rate.

use std::f64::consts::PI;

use artifact::Decimation;
use fixed_dsp::Resampler;
use num_complex::Complex64;

use crate::error::FilterError;

/// Tap of value 1.0, Q2.30.
pub const UNITY: i32 = Resampler::<1, 1>::UNITY;

/// Frequency at which the low-pass attenuates by 6 dB, Hz. With [`KAISER_BETA`], the low-pass
/// attenuates by at most 0.1 dB up to 50 Hz, and by at least 54 dB from 78 Hz, which aliases onto
/// 50 Hz. Chosen from the table in docs/decisions/0007-alias-free-decimation.md.
pub const CUTOFF_HZ: f64 = 62.0;
/// Shape parameter beta of the low-pass's Kaiser window, chosen together with [`CUTOFF_HZ`].
pub const KAISER_BETA: f64 = 5.0;

/// Reciprocal of the duration of the low-pass's impulse response, per second: it lasts 1/8 s,
/// rounded up to a multiple of [`TAPS_MULTIPLE`] samples.
const SPANS_PER_SECOND: u32 = 8;
/// The number of taps of each phase is a multiple of this value.
const TAPS_MULTIPLE: u32 = 4;

/// Largest permitted size in bytes, both of the delay line of all electrodes and of the table of
/// taps: half of the RAM (128 KiB) and an eighth of the flash (512 KiB) of the smallest board
/// (STM32F446, datasheet DS10693).
pub(crate) const LARGEST_BYTES: usize = 65_536;

/// A quantised resampler: output rate = input rate * phases / `down`, in lowest terms.
///
/// Holds the same data as [`Resampler`], but its sizes are known only when the artifact has been
/// read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResamplerTable {
    /// Number of input samples that yield [`phases`](Self::phases) outputs.
    pub down: u16,
    /// Impulse response, Q2.30, `[phase][age]`; age 0 is the newest input sample. Every phase sums
    /// to exactly [`UNITY`], so that a constant passes each phase unchanged.
    pub taps: Vec<Vec<i32>>,
}

impl ResamplerTable {
    /// Designs the resampler from `rate_hz` to `step_rate_hz`, with a delay line for all
    /// electrodes.
    ///
    /// # Errors
    /// If the rates do not allow this decimation, or the resampler would take too much memory.
    pub fn new(
        decimation: Decimation,
        rate_hz: u32,
        step_rate_hz: u32,
        electrodes: usize,
    ) -> Result<Self, FilterError> {
        let common = greatest_common_divisor(rate_hz, step_rate_hz);
        if step_rate_hz == 0 || rate_hz < step_rate_hz {
            return Err(FilterError::BelowStepRate(rate_hz, step_rate_hz));
        }
        let down = u16::try_from(rate_hz / common)
            .map_err(|_| FilterError::RateTerms(rate_hz, step_rate_hz))?;
        let phases = step_rate_hz / common;
        let taps = match decimation {
            Decimation::Literal if phases == 1 => vec![vec![UNITY]],
            Decimation::Literal => {
                return Err(FilterError::LiteralRate(rate_hz, step_rate_hz));
            }
            Decimation::Fir => low_pass(rate_hz, phases as usize, electrodes)?,
        };
        let table = Self { down, taps };
        let magnitude = table.largest_magnitude();
        if magnitude < 1 << 31 {
            Ok(table)
        } else {
            Err(FilterError::ResamplerAccumulator(rate_hz, magnitude))
        }
    }

    /// Returns the number of outputs for every [`down`](Self::down) input samples.
    pub fn phases(&self) -> usize {
        self.taps.len()
    }

    /// Returns the number of input samples that contribute to one output.
    pub fn taps_per_phase(&self) -> usize {
        self.taps[0].len()
    }

    /// Returns the largest magnitude that the accumulator can reach with 32-bit samples, including
    /// the addend for rounding, as a fraction of 2^63.
    pub fn largest_accumulator(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a magnitude has 31 bits")]
        let sum = self.largest_magnitude() as f64 * 2.0_f64.powi(31);
        (sum + f64::from(UNITY / 2)) / 2.0_f64.powi(63)
    }

    /// Returns the sum of a phase's tap magnitudes, Q2.30, for the phase with the largest sum. It
    /// is below 2^31, so the 64-bit accumulator uses at most half of its range.
    pub fn largest_magnitude(&self) -> u64 {
        let magnitude =
            |taps: &Vec<i32>| -> u64 { taps.iter().map(|tap| u64::from(tap.unsigned_abs())).sum() };
        self.taps.iter().map(magnitude).max().unwrap_or(0)
    }

    /// Returns the taps of each phase as f64; each phase sums to 1.
    pub fn phase_responses(&self) -> impl Iterator<Item = Vec<f64>> {
        let real = |tap: &i32| f64::from(*tap) / f64::from(UNITY);
        self.taps.iter().map(move |phase| phase.iter().map(real).collect())
    }

    /// Returns the quantised impulse response of the low-pass before it is split into phases: its
    /// sampling rate is `phases` times the input's, and its sum is 1.
    pub fn prototype(&self) -> Vec<f64> {
        let phases: Vec<Vec<f64>> = self.phase_responses().collect();
        let share = 1.0 / real(phases.len());
        (0..self.taps_per_phase())
            .flat_map(|age| phases.iter().map(move |phase| phase[age] * share))
            .collect()
    }

    /// Returns the complex gain of the prototype at `frequency_hz` for samples at `rate_hz`: the
    /// mean over all phases of the resampler. Its phase angle is relative to the time of an output.
    ///
    /// A tone above half of the output rate appears at its alias frequency with this gain. If the
    /// input rate is not a multiple of the output rate, a tone at `f` also has an image, with the
    /// gain at `k * rate_hz - f`.
    pub fn frequency_response(&self, frequency_hz: f64, rate_hz: f64) -> Complex64 {
        let radians = -2.0 * PI * frequency_hz / (rate_hz * real(self.phases()));
        self.prototype()
            .iter()
            .enumerate()
            .map(|(index, tap)| Complex64::from_polar(*tap, radians * real(index)))
            .sum()
    }
}

/// Designs the anti-aliasing low-pass and splits it into `phases` phases. Returns the taps of each
/// phase, normalised to a gain of 1 at DC and quantised.
fn low_pass(rate_hz: u32, phases: usize, electrodes: usize) -> Result<Vec<Vec<i32>>, FilterError> {
    let taps = rate_hz.div_ceil(SPANS_PER_SECOND).next_multiple_of(TAPS_MULTIPLE) as usize;
    for (what, words) in [
        (format!("the delay line of {electrodes} electrodes"), electrodes * taps),
        ("the table of taps".to_owned(), phases * taps),
    ] {
        let bytes = words * size_of::<i32>();
        if bytes > LARGEST_BYTES {
            return Err(FilterError::ResamplerSize { what, rate_hz, phases, taps, bytes });
        }
    }
    let prototype =
        kaiser_low_pass(phases * taps, CUTOFF_HZ, KAISER_BETA, f64::from(rate_hz) * real(phases));
    Ok((0..phases).map(|phase| quantise(prototype.iter().skip(phase).step_by(phases))).collect())
}

/// Returns the taps of a symmetric low-pass: a sinc times a Kaiser window of shape `beta`, -6 dB at
/// `cutoff_hz`, gain exactly 1 at DC.
///
/// Equals `scipy.signal.firwin(taps, cutoff_hz, window=('kaiser', beta), fs=rate_hz)`.
/// Expects `taps > 1` and `0 < cutoff_hz < rate_hz / 2`.
pub fn kaiser_low_pass(taps: usize, cutoff_hz: f64, beta: f64, rate_hz: f64) -> Vec<f64> {
    let centre = real(taps - 1) / 2.0;
    let width = 2.0 * cutoff_hz / rate_hz;
    let mut response: Vec<f64> = (0..taps)
        .map(|n| {
            let from_centre = real(n) - centre;
            let rise = 1.0 - (from_centre / centre).powi(2);
            sinc(width * from_centre) * bessel_i0(beta * rise.max(0.0).sqrt())
        })
        .collect();
    let at_dc: f64 = response.iter().sum();
    for tap in &mut response {
        *tap /= at_dc;
    }
    response
}

/// Returns the normalised sinc, `sin(pi x) / (pi x)`, and 1 at 0.
fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// Returns the modified Bessel function of the first kind, order 0: the sum of `((x / 2)^k / k!)^2`
/// (Abramowitz and Stegun 9.6.12). All terms are positive, and the series converges quickly.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > f64::EPSILON * sum {
        term *= quarter / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// Quantises the taps of a phase to Q2.30 so that their sum is exactly [`UNITY`]. The largest tap
/// absorbs the rounding error of the sum.
fn quantise<'a>(taps: impl Iterator<Item = &'a f64> + Clone) -> Vec<i32> {
    let scale = f64::from(UNITY) / taps.clone().sum::<f64>();
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a tap is about the cutoff over half the rate at most: below 2"
    )]
    let mut quantised: Vec<i32> = taps.map(|tap| (tap * scale).round() as i32).collect();
    // Wrapping is harmless: `UNITY - sum` is small, so the wrapped difference is correct even if a
    // partial sum wraps.
    let sum = quantised.iter().copied().fold(0, i32::wrapping_add);
    if let Some(largest) = quantised.iter_mut().max_by_key(|tap| tap.unsigned_abs()) {
        *largest = largest.wrapping_add(UNITY.wrapping_sub(sum));
    }
    quantised
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[expect(clippy::cast_precision_loss, reason = "a table has thousands of taps")]
fn real(count: usize) -> f64 {
    count as f64
}
