//! Signal quality of each electrode, once a second.

mod tone;

use model::{ADC_RATE_HZ, ELECTRODES, GUARD_BITS, LSB_NV, STEP_RATE_HZ};
use tone::{Bin, Tone, square_root};

use crate::front_end::Mains;
use crate::sample::{Sample, Step};

/// Limit for a flat electrode, microvolts: an electrode is flat if its samples have a smaller
/// peak-to-peak range in a second.
///
/// The limit is half of the noise of an ADS1299 with shorted inputs at gain 24 and its lowest rate:
/// 0.98 uV peak to peak (SBAS499C, table 1). The noise is higher at every other rate, so the
/// samples of a working converter have a larger range.
pub const FLAT_BELOW_UV: f32 = 0.49;

/// Signal quality of all electrodes within one second, as the device measures it; `link::Quality`
/// is its form on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Index of the first sample of the reported second, counted from the start of the run.
    pub first_sample: u64,
    /// True if the filters had not settled at the first step of the second: the figures of the
    /// filtered steps then include the filters' transient.
    pub settling: bool,
    /// Figures of each electrode, in the order of the montage. ADC channels without an electrode
    /// are omitted.
    pub electrodes: [ElectrodeQuality; ELECTRODES],
}

/// Signal quality of one electrode within one second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ElectrodeQuality {
    /// RMS of the filtered steps, which the encoder reads, microvolts.
    pub rms_uv: f32,
    /// RMS of the mains frequency at the input, microvolts; a bad contact raises it.
    pub mains_uv: f32,
    /// RMS of the mains frequency that remains in the filtered steps, microvolts.
    pub mains_residual_uv: f32,
    /// Number of samples at the ADC's rail, 0..=`model::ADC_RATE_HZ`.
    pub samples_at_rail: u16,
    /// True if the peak-to-peak range of the samples was below [`FLAT_BELOW_UV`].
    pub flat: bool,
}

/// Measures the signal quality of each electrode and reports it once a second.
///
/// The measurement is not part of the path to the code. The owner of an [`Acquisition`] passes each
/// sample to [`Self::observe`], with the step that the sample completed, possibly later and at a
/// lower priority. The figures are for human readers and are computed in f32. Pass each sample
/// exactly once: a missing sample lengthens its second and lowers the mains figures of that second.
///
/// # Timing
/// For each electrode, a sample takes three comparisons and two multiply-adds, a step three
/// multiply-adds, and a report three square roots. The state is eight words for each electrode.
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
///     let step = acquisition.process_sample(&sample);
///     reports.extend(quality.observe(&sample, step.as_ref()));
/// }
/// let [electrode, other] = [7, 8].map(|index| reports[0].electrodes[index]);
/// assert_eq!(electrode.samples_at_rail, model::ADC_RATE_HZ);
/// assert!(electrode.flat && other.samples_at_rail == 0);
/// ```
///
/// [`Acquisition`]: crate::Acquisition
#[derive(Clone, Debug)]
pub struct SignalQuality {
    inputs: [InputSums; ELECTRODES],
    outputs: [OutputSums; ELECTRODES],
    /// DFT bin of the mains frequency, for samples at the ADC's rate.
    input_bin: Bin,
    /// DFT bin of the mains frequency, for samples at the step rate.
    output_bin: Bin,
    first_sample: u64,
    /// Number of samples in this second so far.
    samples: u16,
    settling: bool,
}

/// Extremes and sums of one electrode's samples in this second, before the filters; in counts.
#[derive(Clone, Copy, Debug)]
struct InputSums {
    smallest: i32,
    largest: i32,
    at_rail: u16,
    mains: Tone,
}

/// Sums over one electrode's filtered steps in this second; the steps are counts in Q27.5.
#[derive(Clone, Copy, Debug)]
struct OutputSums {
    squares: f32,
    mains: Tone,
}

impl InputSums {
    const ZERO: Self = Self { smallest: 0, largest: 0, at_rail: 0, mains: Tone::ZERO };
}

impl OutputSums {
    const ZERO: Self = Self { squares: 0.0, mains: Tone::ZERO };
}

/// Returns the DFT bins of a mains frequency at the ADC's rate and at the step rate.
const fn bins(mains: Mains) -> [Bin; 2] {
    const fn bins_at(hz: u8) -> [Bin; 2] {
        [Bin::new(hz, ADC_RATE_HZ), Bin::new(hz, STEP_RATE_HZ)]
    }
    match mains {
        Mains::Hz50 => const { bins_at(50) },
        Mains::Hz60 => const { bins_at(60) },
    }
}

impl SignalQuality {
    /// Creates a measurement for an acquisition with the same mains frequency.
    pub const fn new(mains: Mains) -> Self {
        let [input_bin, output_bin] = bins(mains);
        Self {
            inputs: [InputSums::ZERO; ELECTRODES],
            outputs: [OutputSums::ZERO; ELECTRODES],
            input_bin,
            output_bin,
            first_sample: 0,
            samples: 0,
            settling: false,
        }
    }

    /// Resets the measurement in place, with another mains frequency.
    pub fn restart(&mut self, mains: Mains) {
        [self.input_bin, self.output_bin] = bins(mains);
        self.outputs = [OutputSums::ZERO; ELECTRODES];
        self.first_sample = 0;
        self.samples = 0;
        self.settling = false;
    }

    /// Adds a sample, and the step that the sample completed, if any. Returns a report if the
    /// sample is the last of its second.
    pub fn observe(&mut self, sample: &Sample, step: Option<&Step>) -> Option<Quality> {
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
        self.outputs = [OutputSums::ZERO; ELECTRODES];
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
                *input = InputSums { smallest: count, largest: count, ..InputSums::ZERO };
            }
            input.smallest = input.smallest.min(count);
            input.largest = input.largest.max(count);
            input.at_rail += u16::from(Sample::at_rail(count) != 0);
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
                rms_uv: square_root(squares_mean) * uv_per_filtered,
                mains_uv: input.mains.rms(ADC_RATE_HZ) * UV_PER_COUNT,
                mains_residual_uv: output.mains.rms(STEP_RATE_HZ) * uv_per_filtered,
                samples_at_rail: input.at_rail,
                flat: approximate(input.largest - input.smallest) * UV_PER_COUNT < FLAT_BELOW_UV,
            }
        });
        Quality { first_sample: self.first_sample, settling: self.settling, electrodes }
    }
}

/// Converts to the nearest f32; exact up to 2^24, and so for counts and their differences.
#[expect(clippy::cast_precision_loss, reason = "24 bits suffice for these figures")]
fn approximate(x: i32) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests;
