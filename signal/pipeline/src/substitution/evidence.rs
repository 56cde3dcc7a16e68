//! Sums over one window, from which the quality of each electrode is judged.

use core::f64::consts::TAU;

use model::{ELECTRODES, LSB_NV, STEP_RATE_HZ};

use super::{ElectrodeMask, WINDOW};
use crate::front_end::Mains;
use crate::quality::FLAT_BELOW_UV;
use crate::quarters::{LARGEST, Quarters};
use crate::sample::Sample;

/// Sums and ranges of each electrode over one window of steps and samples.
#[derive(Clone, Debug)]
pub(super) struct Evidence {
    pub(super) electrodes: [Sums; ELECTRODES],
    /// Smallest and largest count of each electrode.
    ranges: [[i32; 2]; ELECTRODES],
    /// Number of samples so far.
    samples: u16,
    /// Electrodes that have been at the ADC's rail in this window.
    pub(super) railed: ElectrodeMask,
    mains: Mains,
    /// Number of steps so far.
    steps: u16,
}

/// Sums of one electrode over the steps of a window, in squares of a quarter microvolt.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums {
    /// Energy of the difference between measurement and prediction.
    pub(super) innovation: u32,
    /// Energy of the prediction.
    pub(super) predicted: u32,
    /// Energy of the measurement.
    pub(super) measured: u32,
    /// Real and imaginary part of the DFT bin of the mains frequency, with a Hann window, times
    /// 2^10.
    mains: [i32; 2],
}

/// Weights of a DFT bin with a Hann window for each step of a window: cosine and sine, times 2^10.
type Weights = [[i16; 2]; WINDOW];

/// RMS at the mains frequency above which an electrode can count as tonal (dominated by mains), in
/// quarters of a microvolt: 20 uV.
const MAINS_ABOVE: u64 = 80;

/// Peak-to-peak range below which an electrode is flat, in counts.
#[expect(clippy::cast_possible_truncation, reason = "a few counts")]
const FLAT_BELOW: i32 = (FLAT_BELOW_UV * 1000.0 / LSB_NV) as i32 + 1;

impl Evidence {
    /// The evidence before the first step of a window, all zeros.
    pub(super) const NONE: Self = Self {
        electrodes: [Sums::ZERO; ELECTRODES],
        ranges: [[0; 2]; ELECTRODES],
        samples: 0,
        railed: 0,
        mains: Mains::Hz50,
        steps: 0,
    };

    /// Starts the next window in place, with the mains frequency `mains`. `ranges` needs no
    /// clearing, because the first sample of the window overwrites it.
    pub(super) fn restart(&mut self, mains: Mains) {
        self.electrodes = [Sums::ZERO; ELECTRODES];
        (self.samples, self.steps) = (0, 0);
        (self.railed, self.mains) = (0, mains);
    }

    pub(super) const fn mains(&self) -> Mains {
        self.mains
    }

    /// Extends the ranges of all electrodes so that they include a sample.
    pub(super) fn add_sample(&mut self, sample: &Sample) {
        let ranges = self.ranges.iter_mut().zip(&sample.counts);
        if self.samples == 0 {
            ranges.for_each(|(range, &count)| *range = [count; 2]);
        } else {
            ranges.for_each(|(range, &count)| {
                *range = [count.min(range[0]), count.max(range[1])];
            });
        }
        self.samples = self.samples.saturating_add(1);
    }

    /// Adds a step: its measured and predicted values, and the electrodes at the rail.
    #[inline(never)]
    pub(super) fn add_step(
        &mut self,
        measured: &Quarters,
        predicted: &Quarters,
        railed: ElectrodeMask,
    ) {
        let weights = weights(self.mains).get(usize::from(self.steps));
        let weights = weights.copied().unwrap_or_default();
        self.steps += 1;
        self.railed |= railed;
        let values = measured.iter().zip(predicted);
        for (sums, (&measured, &predicted)) in self.electrodes.iter_mut().zip(values) {
            sums.add_energies(measured.into(), predicted.into());
        }
        // A separate loop, because one loop with all these sums would need more registers than a
        // microcontroller has.
        for (sums, &measured) in self.electrodes.iter_mut().zip(measured) {
            sums.add_mains(measured.into(), weights);
        }
    }

    /// Returns the electrodes whose peak-to-peak range in the window was below [`FLAT_BELOW_UV`].
    pub(super) fn flat(&self) -> ElectrodeMask {
        // A step that repeats a lost step comes without samples, so a window can have too few
        // samples to judge.
        if usize::from(self.samples) < WINDOW {
            return 0;
        }
        let bits = self.ranges.iter().rev();
        bits.fold(0, |mask, [smallest, largest]| {
            mask << 1 | ElectrodeMask::from(largest - smallest < FLAT_BELOW)
        })
    }
}

impl Sums {
    const ZERO: Self = Self { innovation: 0, predicted: 0, measured: 0, mains: [0; 2] };

    fn add_energies(&mut self, measured: i32, predicted: i32) {
        self.innovation += square(measured - predicted);
        self.predicted += square(predicted);
        self.measured += square(measured);
    }

    fn add_mains(&mut self, measured: i32, weights: [i16; 2]) {
        for (sum, weight) in self.mains.iter_mut().zip(weights) {
            // The sum of 64 steps is at most 64 times 4,096 * 2,048, which is 2^29.
            *sum += measured * i32::from(weight);
        }
    }

    /// Returns whether the RMS at the mains frequency is above [`MAINS_ABOVE`], and the energy at
    /// this frequency is more than half of the measured energy. The RMS is sqrt(2) |T| / (2^10 N),
    /// where T is the DFT sum over N steps.
    pub(super) fn is_tonal(&self) -> bool {
        let [re, im] = self.mains.map(|part| u64::from(part.unsigned_abs()));
        let squares = re * re + im * im;
        let steps = WINDOW as u64;
        let limit = ((MAINS_ABOVE * steps) << 10).pow(2) / 2;
        // Twice the energy at the mains frequency, 2 N rms^2, must exceed the measured energy.
        squares > limit && squares / (steps << 18) > u64::from(self.measured)
    }
}

const fn square(x: i32) -> u32 {
    (x * x).cast_unsigned()
}

const _: () = assert!(
    square(2 * LARGEST - 1) as u64 * WINDOW as u64 <= u32::MAX as u64,
    "the energies of a window must fit 32 bits"
);

const fn weights(mains: Mains) -> &'static Weights {
    #[expect(clippy::cast_precision_loss, reason = "small integers")]
    const fn of(mains_hz: u8) -> Weights {
        let mut weights = [[0; 2]; WINDOW];
        let mut step = 0;
        while step < WINDOW {
            let hann = 1.0 - cosine(step as f64 / WINDOW as f64);
            let turns = mains_hz as f64 * step as f64 / STEP_RATE_HZ as f64;
            weights[step] = [scaled(hann * cosine(turns)), scaled(hann * cosine(turns - 0.25))];
            step += 1;
        }
        weights
    }
    const HZ_50: &Weights = &of(50);
    const HZ_60: &Weights = &of(60);
    match mains {
        Mains::Hz50 => HZ_50,
        Mains::Hz60 => HZ_60,
    }
}

/// Returns `x` times 2^10, rounded.
#[expect(clippy::cast_possible_truncation, reason = "|x| <= 2")]
const fn scaled(x: f64) -> i16 {
    let half = if x < 0.0 { -0.5 } else { 0.5 };
    (x * 1024.0 + half) as i16
}

/// Returns the cosine of an angle in turns, by its power series.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "fewer than a hundred turns"
)]
const fn cosine(turns: f64) -> f64 {
    let angle = TAU * (turns - turns as i64 as f64);
    let (mut sum, mut term, mut order) = (0.0, 1.0, 0.0);
    // The first omitted term is below (2 pi)^40 / 40! = 1e-16.
    while order < 40.0 {
        sum += term;
        term *= -angle * angle / ((order + 1.0) * (order + 2.0));
        order += 2.0;
    }
    sum
}
