//! What each electrode delivers, second by second.

mod tone;

use model::{ADC_RATE_HZ, ELECTRODES, GUARD_BITS, LSB_NV, STEP_RATE_HZ};

use crate::{Mains, Sample, Step};
use tone::{Bin, Tone, root};

/// Difference between the largest and the smallest sample of a second below which an electrode is
/// flat, microvolt.
///
/// Half of what an ADS1299 reads from a shorted input at gain 24 and its lowest rate, 0.98 uV peak
/// to peak (SBAS499C, table 1; more at every other rate): a converter that works is never so quiet.
pub const FLAT_BELOW_UV: f32 = 0.49;

/// What every electrode delivered within one second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Index of the second's first sample, since the start.
    pub first_sample: u64,
    /// True if the filters had not settled at some step: the filtered figures show their start as
    /// well.
    pub settling: bool,
    /// The index is the electrode. ADC channels without one are left out: what they read says
    /// nothing about anybody's head.
    pub electrodes: [ElectrodeQuality; ELECTRODES],
}

/// What one electrode delivered within one second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ElectrodeQuality {
    /// RMS of the filtered steps, microvolt: what the encoder reads.
    pub rms_uv: f32,
    /// RMS of the mains frequency at the input, microvolt: a bad contact has much of it.
    pub mains_uv: f32,
    /// RMS of the mains frequency left in the filtered steps, microvolt.
    pub mains_residual_uv: f32,
    /// Samples at the ADC's rail, 0 to `model::ADC_RATE_HZ`.
    pub samples_at_rail: u16,
    /// The samples differed by less than [`FLAT_BELOW_UV`].
    pub flat: bool,
}

/// Reports every second on the signal of each electrode.
///
/// It changes nothing and nobody in the pipeline waits for it: whoever has an [`Acquisition`] shows
/// it each sample with the step that came of it, later and at a lower priority if that suits.
/// f32 on purpose, being figures for people; the path to the code has none. Each sample must be
/// shown once: a lost one lengthens its second and lowers that second's mains figures.
///
/// # Timing
/// Per electrode and sample three comparisons and two multiply-adds; eight words of state. The report
/// itself takes three square roots per electrode.
///
/// ```
/// use pipeline::{Acquisition, Mains, Sample, SignalQuality};
///
/// let mut acquisition = Acquisition::new(Mains::Hz50);
/// let mut quality = SignalQuality::new(Mains::Hz50);
/// let mut reports = Vec::new();
/// for _ in 0..model::ADC_RATE_HZ {
///     let mut sample = Sample::default();
///     sample.counts[7] = Sample::MAX;
///     let step = acquisition.push(&sample);
///     reports.extend(quality.push(&sample, step.as_ref()));
/// }
/// let [electrode, other] = [7, 8].map(|index| reports[0].electrodes[index]);
/// assert_eq!(electrode.samples_at_rail, model::ADC_RATE_HZ);
/// assert!(electrode.flat && other.samples_at_rail == 0);
/// ```
///
/// [`Acquisition`]: crate::Acquisition
#[derive(Clone, Debug)]
pub struct SignalQuality {
    inputs: [Input; ELECTRODES],
    outputs: [Output; ELECTRODES],
    /// The mains frequency at the ADC's rate and at the steps'.
    input_bin: Bin,
    output_bin: Bin,
    first_sample: u64,
    /// Samples of this second so far.
    samples: u16,
    settling: bool,
}

/// One electrode before the filters, this second so far; counts.
#[derive(Clone, Copy, Debug)]
struct Input {
    least: i32,
    most: i32,
    at_rail: u16,
    mains: Tone,
}

/// One electrode behind the filters, this second so far; counts, Q27.5.
#[derive(Clone, Copy, Debug)]
struct Output {
    squares: f32,
    mains: Tone,
}

impl Input {
    const NOTHING: Self = Self {
        least: 0,
        most: 0,
        at_rail: 0,
        mains: Tone::SILENCE,
    };
}

impl Output {
    const NOTHING: Self = Self {
        squares: 0.0,
        mains: Tone::SILENCE,
    };
}

/// The mains frequency at the ADC's rate and at the steps'.
const fn bins(mains: Mains) -> [Bin; 2] {
    const fn of(hz: u8) -> [Bin; 2] {
        [Bin::new(hz, ADC_RATE_HZ), Bin::new(hz, STEP_RATE_HZ)]
    }
    match mains {
        Mains::Hz50 => const { of(50) },
        Mains::Hz60 => const { of(60) },
    }
}

impl SignalQuality {
    /// Nothing seen yet; the mains are the ones that the acquisition removes.
    pub const fn new(mains: Mains) -> Self {
        let [input_bin, output_bin] = bins(mains);
        Self {
            inputs: [Input::NOTHING; ELECTRODES],
            outputs: [Output::NOTHING; ELECTRODES],
            input_bin,
            output_bin,
            first_sample: 0,
            samples: 0,
            settling: false,
        }
    }

    /// Forgets what it has seen, in place.
    pub fn restart(&mut self, mains: Mains) {
        [self.input_bin, self.output_bin] = bins(mains);
        self.outputs = [Output::NOTHING; ELECTRODES];
        self.first_sample = 0;
        self.samples = 0;
        self.settling = false;
    }

    /// Takes a sample and the step that came of it, if one did; the last sample of a second gives
    /// that second's report.
    pub fn push(&mut self, sample: &Sample, step: Option<&Step>) -> Option<Quality> {
        self.add_sample(sample);
        if let Some(step) = step {
            self.add_step(step);
        }
        if self.samples < ADC_RATE_HZ {
            return None;
        }
        let report = self.report();
        self.first_sample += u64::from(ADC_RATE_HZ);
        self.samples = 0;
        self.settling = false;
        self.outputs = [Output::NOTHING; ELECTRODES];
        self.input_bin.restart();
        self.output_bin.restart();
        Some(report)
    }

    fn add_sample(&mut self, sample: &Sample) {
        let weights = self.input_bin.next_weights();
        let is_first = self.samples == 0;
        self.samples += 1;
        for (input, &count) in self.inputs.iter_mut().zip(&sample.counts) {
            if is_first {
                *input = Input {
                    least: count,
                    most: count,
                    ..Input::NOTHING
                };
            }
            input.least = input.least.min(count);
            input.most = input.most.max(count);
            input.at_rail += u16::from(Sample::rail(count) != 0);
            input.mains.add(approximate(count), weights);
        }
    }

    fn add_step(&mut self, step: &Step) {
        let weights = self.output_bin.next_weights();
        self.settling |= step.settling;
        for (output, &filtered) in self.outputs.iter_mut().zip(&step.electrodes) {
            let x = approximate(filtered);
            output.squares += x * x;
            output.mains.add(x, weights);
        }
    }

    fn report(&self) -> Quality {
        const UV_PER_COUNT: f32 = LSB_NV / 1000.0;
        let uv_per_filtered = UV_PER_COUNT / f32::from(1_u16 << GUARD_BITS);
        let electrodes = core::array::from_fn(|index| {
            let (input, output) = (&self.inputs[index], &self.outputs[index]);
            let squares_mean = output.squares / f32::from(STEP_RATE_HZ);
            ElectrodeQuality {
                rms_uv: root(squares_mean) * uv_per_filtered,
                mains_uv: input.mains.rms(ADC_RATE_HZ) * UV_PER_COUNT,
                mains_residual_uv: output.mains.rms(STEP_RATE_HZ) * uv_per_filtered,
                samples_at_rail: input.at_rail,
                flat: approximate(input.most - input.least) * UV_PER_COUNT < FLAT_BELOW_UV,
            }
        });
        Quality {
            first_sample: self.first_sample,
            settling: self.settling,
            electrodes,
        }
    }
}

/// The nearest f32; exact up to 2^24, which neither a count nor a difference of two exceeds.
#[expect(clippy::cast_precision_loss, reason = "figures for people, to 24 bits")]
fn approximate(x: i32) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests;
