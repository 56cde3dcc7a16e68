//! From samples to steps: filters, resampler, scalp grid, quantisation, and what was lost there.

use model::{ADC_RATE_HZ, PHASES, RESAMPLER, TAPS};

use crate::{FrontEnd, Mains, Sample, Step, quantise};

/// The half of the pipeline that runs at the ADC's rate.
#[derive(Clone, Debug)]
pub struct Acquisition {
    front_end: FrontEnd<'static, Mains, PHASES, TAPS>,
    settling_samples: u64,
    samples: u64,
    /// ADC channels that stood at the rail since the last step, one bit each.
    saturated: u64,
    clipped_total: u32,
    saturated_total: u32,
}

impl Acquisition {
    /// An acquisition at rest for this mains frequency.
    pub const fn new(mains: Mains) -> Self {
        Self {
            front_end: FrontEnd::new(mains, &RESAMPLER),
            settling_samples: mains.filter().settling_samples as u64,
            samples: 0,
            saturated: 0,
            clipped_total: 0,
            saturated_total: 0,
        }
    }

    /// Forgets the signal, in place, and goes to rest for this mains frequency. What it has counted
    /// begins again.
    pub fn restart(&mut self, mains: Mains) {
        self.front_end.restart(mains);
        self.settling_samples = mains.filter().settling_samples.into();
        self.samples = 0;
        self.saturated = 0;
        self.clipped_total = 0;
        self.saturated_total = 0;
    }

    /// Takes one sample; gives the step that is due with it, if one is: with 512 Hz every fourth
    /// sample, the first one included.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Option<Step> {
        let rails = sample.rails();
        self.saturated |= rails;
        self.saturated_total = self.saturated_total.wrapping_add(rails.count_ones());
        let index = self.samples;
        self.samples += 1;
        let (electrodes, phase) = self.front_end.push(sample)?;
        let (plane, clipped) = quantise(&electrodes);
        self.clipped_total = self.clipped_total.wrapping_add(u32::from(clipped));
        Some(Step {
            sample: index,
            offset_us: offset_us(phase, PHASES, ADC_RATE_HZ),
            electrodes,
            plane,
            clipped,
            saturated: core::mem::take(&mut self.saturated),
            settling: index < self.settling_samples,
        })
    }

    /// Samples taken since the start.
    pub const fn samples(&self) -> u64 {
        self.samples
    }

    /// Electrode values that the int8 input clipped since the start, each once; wraps.
    pub const fn clipped(&self) -> u32 {
        self.clipped_total
    }

    /// Counts at the ADC's rail since the start, of all channels, each once; wraps.
    pub const fn saturated(&self) -> u32 {
        self.saturated_total
    }
}

/// How much later than its sample a step of this phase stands, microseconds, rounded down.
#[expect(
    clippy::cast_possible_truncation,
    reason = "phase < phases: less than a sample, which lasts less than 2^16 us"
)]
const fn offset_us(phase: usize, phases: usize, rate_hz: u16) -> u16 {
    (phase as u64 * 1_000_000 / (phases as u64 * rate_hz as u64)) as u16
}

const _: () = assert!(ADC_RATE_HZ > 15, "a sample lasts less than 2^16 us");

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use model::CHANNELS;

    use super::*;

    fn steps(mains: Mains, samples: impl IntoIterator<Item = Sample>) -> Vec<Step> {
        let mut acquisition = Acquisition::new(mains);
        samples
            .into_iter()
            .filter_map(|sample| acquisition.push(&sample))
            .collect()
    }

    #[test]
    fn an_acquisition_that_restarts_is_as_good_as_new() {
        let sample = |index: i32| Sample {
            counts: core::array::from_fn(|channel| {
                let channel = i32::try_from(channel).expect("few channels");
                index * 997 % 10_007 + channel * 113
            }),
        };
        let steps = |acquisition: &mut Acquisition| -> Vec<Step> {
            (0..90)
                .filter_map(|index| acquisition.push(&sample(index)))
                .collect()
        };
        let expected = steps(&mut Acquisition::new(Mains::Hz60));
        let mut acquisition = Acquisition::new(Mains::Hz50);
        for samples in [1, 2, 77] {
            for index in 500..500 + samples {
                acquisition.push(&sample(index));
            }
            acquisition.restart(Mains::Hz60);
            assert_eq!(steps(&mut acquisition), expected);
        }
    }

    #[test]
    fn a_step_names_the_sample_that_it_was_picked_from() {
        let picked: Vec<u64> = steps(Mains::Hz50, [Sample::default(); 12])
            .iter()
            .map(|step| step.sample)
            .collect();
        assert_eq!(picked, [0, 4, 8]);
    }

    #[test]
    fn a_step_between_two_samples_says_how_much_later_it_is() {
        // 1000 -> 128 Hz: 16 phases of 62.5 us.
        let offsets = [0, 1, 4, 15].map(|phase| offset_us(phase, 16, 1_000));
        assert_eq!(offsets, [0, 62, 250, 937]);
    }

    #[test]
    fn a_channel_at_the_rail_is_named_by_the_step_that_follows() {
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
            seen.extend(acquisition.push(&sample).map(|step| step.saturated));
        }
        assert_eq!(seen, [0, 0, 1 << 4, 1 << (CHANNELS - 1), 0]);
        assert_eq!(acquisition.saturated(), 5);
    }

    #[test]
    fn when_the_settling_mark_is_gone_a_step_at_the_input_has_decayed() {
        for mains in [Mains::Hz50, Mains::Hz60] {
            // 100 mV on every channel, from the first sample on.
            let count = 4_473_924;
            let steps = steps(
                mains,
                (0..8_192).map(|_| Sample {
                    counts: [count; CHANNELS],
                }),
            );
            let settled: Vec<&Step> = steps.iter().filter(|step| !step.settling).collect();
            assert!(settled.len() > 500);
            let limit = (count << model::GUARD_BITS) / 10_000 + (1 << model::GUARD_BITS);
            for step in settled {
                assert!(step.electrodes[0].abs() <= limit, "sample {}", step.sample);
            }
            // The mark does not last for no reason: shortly before its end the limit is exceeded.
            let marked = steps
                .iter()
                .rfind(|step| step.settling && step.electrodes[0].abs() > limit);
            assert!(marked.is_some_and(|step| step.sample + 64 > settled_at(mains)));
        }
    }

    fn settled_at(mains: Mains) -> u64 {
        u64::from(mains.filter().settling_samples)
    }
}
