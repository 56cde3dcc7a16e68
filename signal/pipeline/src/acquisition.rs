//! From samples to steps: filters, resampler, scalp grid, quantisation.

use model::{ADC_RATE_HZ, PHASES, RESAMPLER, SUBSTITUTION, TAPS};

use crate::code::Code;
use crate::encoder::Encoder;
use crate::front_end::{FrontEnd, Mains};
use crate::sample::{Sample, Step, quantise};
use crate::substitution::{ExclusionPolicy, Substitution};

/// The half of the pipeline that runs at the ADC's rate: from samples to steps.
#[derive(Clone, Debug)]
pub struct Acquisition {
    front_end: FrontEnd<'static, Mains, PHASES, TAPS>,
    settling_samples: u64,
    samples: u64,
    /// ADC channels that were at the rail in any sample since the last step; bit n is channel n.
    saturated: u64,
}

impl Acquisition {
    /// Creates an acquisition at rest, with the filters for a mains frequency.
    pub const fn new(mains: Mains) -> Self {
        Self {
            front_end: FrontEnd::new(mains, &RESAMPLER),
            settling_samples: mains.filter().settling_samples as u64,
            samples: 0,
            saturated: 0,
        }
    }

    /// Resets in place, with the filters for a mains frequency; samples count from 0 again.
    pub fn restart(&mut self, mains: Mains) {
        self.front_end.restart(mains);
        self.settling_samples = mains.filter().settling_samples.into();
        self.samples = 0;
        self.saturated = 0;
    }

    /// Processes one sample. Returns a step if one is due with this sample: at 512 Hz, with the
    /// first sample and with every fourth sample after it.
    ///
    /// Not inlined, because firmware compiles its own code for size: inlined there, the filters
    /// would be compiled for size too, and not for speed.
    #[inline(never)]
    pub fn process_sample(&mut self, sample: &Sample) -> Option<Step> {
        self.saturated |= sample.channels_at_rail();
        let index = self.samples;
        self.samples += 1;
        let (electrodes, phase) = self.front_end.filter_sample(sample)?;
        let (plane, clipped) = quantise(&electrodes);
        Some(Step {
            sample: index,
            offset_us: offset_us(phase, PHASES, ADC_RATE_HZ),
            electrodes,
            plane,
            clipped,
            saturated: core::mem::take(&mut self.saturated),
            settling: index < self.settling_samples,
            excluded: 0,
        })
    }

    /// Returns the number of samples processed in the run.
    pub const fn samples(&self) -> u64 {
        self.samples
    }
}

/// Returns the time from an ADC sample to the step that is due with this sample, in microseconds,
/// rounded down: `phase / phases` of the time between two samples.
#[expect(
    clippy::cast_possible_truncation,
    reason = "phase < phases: less than the time between two samples, below 2^16 us"
)]
const fn offset_us(phase: usize, phases: usize, rate_hz: u16) -> u16 {
    (phase as u64 * 1_000_000 / (phases as u64 * rate_hz as u64)) as u16
}

const _: () = assert!(ADC_RATE_HZ > 15, "the time between two samples must be below 2^16 us");

/// Acquisition, substitution of bad electrodes and encoder in one, for programs that run all three
/// at the same priority. The codes equal those of a device with [`ExclusionPolicy::AUTOMATIC`].
#[derive(Clone, Debug)]
pub struct Pipeline {
    acquisition: Acquisition,
    /// Empty if the model has no table of substitutions.
    substitution: [Substitution; SUBSTITUTION.is_some() as usize],
    encoder: Encoder<'static>,
}

impl Pipeline {
    /// Creates a pipeline at rest, with the filters for a mains frequency.
    pub fn new(mains: Mains) -> Self {
        let mut substitution = [const { Substitution::NEW }; SUBSTITUTION.is_some() as usize];
        for substitution in &mut substitution {
            substitution.restart(mains);
        }
        Self { acquisition: Acquisition::new(mains), substitution, encoder: Encoder::new() }
    }

    /// Processes one sample. Returns a code if the sample completes a window: the first code with
    /// the sample of step 15, counted from 0, then one code for every hop.
    #[inline]
    pub fn encode_sample(&mut self, sample: &Sample) -> Option<Code> {
        for substitution in &mut self.substitution {
            substitution.observe_sample(sample);
        }
        let mut step = self.acquisition.process_sample(sample)?;
        if let (Some(table), [substitution]) = (&SUBSTITUTION, &mut self.substitution[..]) {
            substitution.fill_step(&mut step, ExclusionPolicy::AUTOMATIC, table);
        }
        self.encoder.encode_step(&step)
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use model::{CHANNELS, HOP, STEP_RATE_HZ, STEPS};

    use super::*;

    fn steps(mains: Mains, samples: impl IntoIterator<Item = Sample>) -> Vec<Step> {
        let mut acquisition = Acquisition::new(mains);
        samples.into_iter().filter_map(|sample| acquisition.process_sample(&sample)).collect()
    }

    #[test]
    fn a_restarted_acquisition_equals_a_new_one() {
        let sample = |index: i32| Sample {
            counts: core::array::from_fn(|channel| {
                let channel = i32::try_from(channel).expect("few channels");
                index * 997 % 10_007 + channel * 113
            }),
        };
        let steps = |acquisition: &mut Acquisition| -> Vec<Step> {
            (0..90).filter_map(|index| acquisition.process_sample(&sample(index))).collect()
        };
        let expected = steps(&mut Acquisition::new(Mains::Hz60));
        let mut acquisition = Acquisition::new(Mains::Hz50);
        for samples in [1, 2, 77] {
            for index in 500..500 + samples {
                acquisition.process_sample(&sample(index));
            }
            acquisition.restart(Mains::Hz60);
            assert_eq!(steps(&mut acquisition), expected);
        }
    }

    #[test]
    fn a_step_between_two_samples_carries_its_offset() {
        // Resampling from 1000 Hz to 128 Hz has 16 phases, 62.5 us apart, between two samples.
        let offsets = [0, 1, 4, 15].map(|phase| offset_us(phase, 16, 1_000));
        assert_eq!(offsets, [0, 62, 250, 937]);
    }

    #[test]
    fn the_next_step_marks_a_channel_that_was_at_the_rail() {
        let mut acquisition = Acquisition::new(Mains::Hz50);
        let mut seen = Vec::new();
        for index in 0..20 {
            let mut sample = Sample::default();
            if (5..=8).contains(&index) {
                sample.counts[4] = -Sample::MAX - 1;
            }
            if index == 9 {
                sample.counts[CHANNELS - 1] = Sample::MAX;
            }
            seen.extend(acquisition.process_sample(&sample).map(|step| step.saturated));
        }
        assert_eq!(seen, [0, 0, 1 << 4, 1 << (CHANNELS - 1), 0]);
    }

    #[test]
    fn after_the_settling_flag_clears_an_input_step_has_decayed() {
        for mains in [Mains::Hz50, Mains::Hz60] {
            // An input step of 100 mV on every channel, at the first sample.
            let count = 4_473_924;
            let steps = steps(mains, (0..8_192).map(|_| Sample { counts: [count; CHANNELS] }));
            let settled: Vec<&Step> = steps.iter().filter(|step| !step.settling).collect();
            assert!(settled.len() > 500);
            let limit = (count << model::GUARD_BITS) / 10_000 + (1 << model::GUARD_BITS);
            for step in settled {
                assert!(step.electrodes[0].abs() <= limit, "sample {}", step.sample);
            }
            // The flag is not set longer than necessary: the output still exceeds the limit within
            // the last 64 samples before the flag clears.
            let flagged =
                steps.iter().rfind(|step| step.settling && step.electrodes[0].abs() > limit);
            assert!(flagged.is_some_and(|step| step.sample + 64 > settled_at(mains)));
        }
    }

    fn settled_at(mains: Mains) -> u64 {
        u64::from(mains.filter().settling_samples)
    }

    #[test]
    fn a_code_is_due_every_hop_and_carries_its_first_sample() {
        let mut pipeline = Pipeline::new(Mains::Hz50);
        let codes: Vec<(usize, Code)> = (0..1_024)
            .filter_map(|index| Some((index, pipeline.encode_sample(&Sample::default())?)))
            .collect();
        let samples = |steps: usize| steps * usize::from(ADC_RATE_HZ) / usize::from(STEP_RATE_HZ);
        for (number, (sample, code)) in codes.iter().enumerate() {
            assert_eq!(code.window as usize, number);
            assert_eq!(code.first_sample, samples(number * HOP) as u64);
            // A code is due with the ADC sample of its window's last step.
            assert_eq!(*sample, samples(number * HOP + STEPS - 1));
        }
        assert_eq!(codes.len(), 1 + (1_024 / samples(1) - STEPS) / HOP);
    }
}
