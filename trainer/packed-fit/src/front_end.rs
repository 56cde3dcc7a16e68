//! The device's front end for any description: filters and resampler whose sizes are known only at
//! run time. Their outputs equal the device's bit for bit.

use crate::error::FitError;
use artifact::Description;
use fixed_dsp::{Cascade, CascadeState, Filter};
use model_gen::ResamplerTable;
use model_gen::headroom::GUARD_BITS;
use std::collections::VecDeque;

/// The filters of all electrodes.
pub(crate) struct Filters {
    sections: Vec<Cascade<1>>,
    /// For each electrode, the states of all sections.
    states: Vec<Vec<CascadeState<1>>>,
}

impl Filters {
    /// Creates the filters of a description for a mains frequency; their states are 0.
    pub(crate) fn new(description: &Description, mains_hz: u32) -> Result<Self, FitError> {
        let rate_hz = description.adc.rate_hz;
        let sections = model_gen::filter_cascade(&description.filters, rate_hz, mains_hz)
            .map_err(|source| FitError::Filter(mains_hz, source))?;
        let states = vec![CascadeState::REST; sections.len()];
        let cascade = |section| Cascade {
            sections: [section],
        };
        Ok(Self {
            sections: sections.into_iter().map(cascade).collect(),
            states: vec![states; description.montage.electrodes.len()],
        })
    }

    /// Filters one sample of each electrode, in counts; returns counts x 2^5 (Q27.5).
    pub(crate) fn filter_sample(&mut self, counts: &[i32]) -> Vec<i32> {
        let electrodes = counts.iter().zip(&mut self.states);
        let filtered = electrodes.map(|(&count, states)| {
            let sections = self.sections.iter().zip(states);
            sections.fold(count << GUARD_BITS, |x, (section, state)| {
                section.apply(state, x)
            })
        });
        filtered.collect()
    }
}

/// Resampler from the ADC's rate to the step rate.
pub(crate) struct Resampler {
    table: ResamplerTable,
    /// The last filtered samples, as many as a phase has taps, newest first.
    newest: VecDeque<Vec<i32>>,
    /// Time from the next input sample to the next output, in units of a sample period divided by
    /// the number of phases.
    ahead: usize,
}

impl Resampler {
    /// Creates a resampler whose previous samples are all 0.
    pub(crate) fn new(description: &Description) -> Result<Self, FitError> {
        let table = ResamplerTable::new(
            description.filters.decimation,
            description.adc.rate_hz,
            description.window.rate_hz,
            description.montage.electrodes.len(),
        )
        .map_err(FitError::Resampler)?;
        Ok(Self {
            newest: vec![vec![0; description.montage.electrodes.len()]; table.taps_per_phase()]
                .into(),
            table,
            ahead: 0,
        })
    }

    /// Adds a filtered sample; returns an output if one is due at this sample.
    pub(crate) fn resample(&mut self, filtered: Vec<i32>) -> Option<Vec<i32>> {
        let electrodes = filtered.len();
        self.newest.pop_back();
        self.newest.push_front(filtered);
        let phases = self.table.phases();
        if self.ahead >= phases {
            self.ahead -= phases;
            return None;
        }
        let taps = &self.table.taps[self.ahead];
        self.ahead += usize::from(self.table.down) - phases;
        let output = |electrode| {
            let samples = self.newest.iter().map(|sample| sample[electrode]);
            let sum: i64 = taps
                .iter()
                .zip(samples)
                .map(|(&tap, x)| i64::from(tap) * i64::from(x))
                .sum();
            // The Q2.30 taps add 30 fraction bits to the sum. Round half up to remove them.
            i32::try_from((sum + (1 << 29)) >> 30).expect("model-gen proves the head room")
        };
        Some((0..electrodes).map(output).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artifact::{Artifact, Decimation};
    use pipeline::{FrontEnd, Sample};
    use std::path::Path;

    #[test]
    fn outputs_equal_the_device_s_bit_for_bit_at_a_rational_ratio() {
        let paper = Path::new("../../signal/model/paper");
        let mut description = Artifact::read(paper).unwrap().description;
        description.adc.rate_hz = 500;
        description.filters.decimation = Decimation::Fir;
        let mut filters = Filters::new(&description, 50).expect("usual filters");
        let mut resampler = Resampler::new(&description).expect("a usual rate");
        let sections = model_gen::filter_cascade(&description.filters, 500, 50).expect("the same");
        let cascade = Cascade::<6> {
            sections: sections.try_into().expect("six sections"),
        };
        let on_device = fixed_dsp::Resampler {
            down: resampler.table.down,
            taps: std::array::from_fn::<_, 32, _>(|phase| {
                std::array::from_fn::<_, 64, _>(|age| resampler.table.taps[phase][age])
            }),
        };
        let mut device = FrontEnd::new(cascade, &on_device);
        let mut outputs = 0;
        for n in 0..4_000_i32 {
            let counts = std::array::from_fn(|channel| {
                let channel = i32::try_from(channel).expect("64 channels");
                (n.wrapping_mul(n).wrapping_mul(31_337) + channel * 977) % 4_000_003
            });
            let expected = device.filter_sample(&Sample { counts });
            let expected = expected.map(|(step, _)| step.to_vec());
            let electrodes = description.montage.electrodes.len();
            let filtered = filters.filter_sample(&counts[..electrodes]);
            assert_eq!(resampler.resample(filtered), expected, "sample {n}");
            outputs += usize::from(expected.is_some());
        }
        assert_eq!(outputs, 4_000 * 128 / 500);
    }
}
