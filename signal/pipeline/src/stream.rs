//! The whole pipeline from sample to code.

use crate::{acquisition::Acquisition, code::Code, encoder::Encoder, mains::Mains, sample::Sample};

/// Acquisition and encoder in one, for programs that do not run them at different priorities.
#[derive(Clone, Debug)]
pub struct Pipeline {
    acquisition: Acquisition,
    encoder: Encoder<'static>,
}

impl Pipeline {
    /// Creates a pipeline at rest, with the filters for a mains frequency.
    pub fn new(mains: Mains) -> Self {
        Self {
            acquisition: Acquisition::new(mains),
            encoder: Encoder::new(),
        }
    }

    /// Processes one sample. Returns a code if the sample completes a window: the first with the sample
    /// of step 15, then one for every hop.
    #[inline]
    pub fn encode_sample(&mut self, sample: &Sample) -> Option<Code> {
        let step = self.acquisition.process_sample(sample)?;
        self.encoder.encode_step(&step)
    }

    /// Returns the acquisition, for its counters.
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
