//! Filters of the device's front end, for any description.

use crate::error::TrainerError;
use artifact::Description;
use fixed_dsp::{Cascade, CascadeState, Filter};
use model_gen::headroom::GUARD_BITS;

/// Filters with the same output bits as the device's, but with numbers of sections and electrodes that
/// are known only at run time.
pub(crate) struct Filters {
    sections: Vec<Cascade<1>>,
    /// State of each section, for each electrode.
    states: Vec<Vec<CascadeState<1>>>,
}

impl Filters {
    /// Creates the filters of a description at rest, for a mains frequency.
    pub(crate) fn new(description: &Description, mains_hz: u32) -> Result<Self, TrainerError> {
        let rate_hz = description.adc.rate_hz;
        let sections = model_gen::filter_cascade(&description.filters, rate_hz, mains_hz)
            .map_err(|source| TrainerError::Filter { mains_hz, source })?;
        let states = vec![CascadeState::REST; sections.len()];
        let cascade = |section| Cascade {
            sections: [section],
        };
        Ok(Self {
            sections: sections.into_iter().map(cascade).collect(),
            states: vec![states; description.montage.electrodes.len()],
        })
    }

    /// Filters one sample of each electrode, counts; returns counts x 2^5 (Q27.5).
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use pipeline::{FrontEnd, Sample};

    #[test]
    fn sections_one_by_one_equal_the_device_s_cascade_bit_for_bit() {
        let description = testing::description();
        let mut filters = Filters::new(&description, 50).expect("the paper's filters");
        let sections = model_gen::filter_cascade(&description.filters, 512, 50).expect("the same");
        let cascade = Cascade::<6> {
            sections: sections.try_into().expect("six sections"),
        };
        let every = fixed_dsp::Resampler::every(1);
        let mut device = FrontEnd::new(cascade, &every);
        for n in 0..4_000_i32 {
            let counts = std::array::from_fn(|channel| {
                let channel = i32::try_from(channel).expect("few channels");
                (n.wrapping_mul(n).wrapping_mul(31_337) + channel * 977) % 4_000_003
            });
            let (expected, _) = device
                .filter_sample(&Sample { counts })
                .expect("every sample");
            assert_eq!(
                filters.filter_sample(&counts)[..expected.len()],
                expected,
                "sample {n}"
            );
        }
    }
}
