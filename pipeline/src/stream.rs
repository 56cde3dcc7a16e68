//! The whole path, from sample to code.

use crate::{Acquisition, Code, Encoder, Mains, Sample};

/// The pipeline: acquisition and encoder in one, for those who need not run them apart.
#[derive(Clone, Debug)]
pub struct Pipeline {
    acquisition: Acquisition,
    encoder: Encoder<'static>,
}

impl Pipeline {
    /// A pipeline at rest for this mains frequency.
    pub fn new(mains: Mains) -> Self {
        Self {
            acquisition: Acquisition::new(mains),
            encoder: Encoder::new(),
        }
    }

    /// Takes one sample; the one that completes a window gives its code: the first after 15 steps
    /// and a sample, every further one a hop later.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Option<Code> {
        let step = self.acquisition.push(sample)?;
        self.encoder.push(&step)
    }

    /// The half that runs at the ADC's rate, for its counters.
    pub const fn acquisition(&self) -> &Acquisition {
        &self.acquisition
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ, STEPS};

    #[test]
    fn a_code_comes_every_hop_and_names_its_first_sample() {
        let mut pipeline = Pipeline::new(Mains::Hz50);
        let codes: Vec<(usize, Code)> = (0..1_024)
            .filter_map(|index| Some((index, pipeline.push(&Sample::default())?)))
            .collect();
        let samples = |steps: usize| steps * usize::from(ADC_RATE_HZ) / usize::from(STEP_RATE_HZ);
        for (number, (sample, code)) in codes.iter().enumerate() {
            assert_eq!(code.window as usize, number);
            assert_eq!(code.first_sample, samples(number * HOP) as u64);
            // It comes with the sample of the window's last step, not later.
            assert_eq!(*sample, samples(number * HOP + STEPS - 1));
        }
        assert_eq!(codes.len(), 1 + (1_024 / samples(1) - STEPS) / HOP);
    }
}
