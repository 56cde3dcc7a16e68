//! The whole path, from sample to code.

use model::{CHANNELS, DECIMATION, ELECTRODES, HOP, STEPS};

use crate::{Code, Encoder, FrontEnd, Mains, Quantiser, Sample, window::OPEN};

/// The pipeline: filters, decimation, scalp grid, quantisation and encoder.
///
/// A new one is at rest; codes carry `settling` until the filters' answer to the electrodes'
/// offset has decayed.
#[derive(Clone, Debug)]
pub struct Pipeline {
    front_end: FrontEnd,
    encoder: Encoder,
    /// Samples pushed so far.
    samples: u64,
    settling_samples: u64,
    /// What was lost in each half of a window (whole window when windows do not overlap).
    parts: [Losses; OPEN],
    /// Time steps pushed so far.
    steps: u64,
}

/// Values that could not be represented.
#[derive(Clone, Copy, Debug, Default)]
struct Losses {
    clipped: u16,
    saturated: u16,
}

impl Pipeline {
    /// A pipeline at rest for this mains frequency.
    pub fn new(mains: Mains) -> Self {
        let filter = mains.filter();
        Self {
            front_end: FrontEnd::new(filter.cascade, DECIMATION),
            encoder: Encoder::new(),
            samples: 0,
            settling_samples: u64::from(filter.settling_samples),
            parts: [Losses::default(); OPEN],
            steps: 0,
        }
    }

    /// Takes one sample; every `4 * HOP`-th completes a window and gives its code.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Option<Code> {
        let part = self.current_part();
        self.parts[part].saturated = self.parts[part]
            .saturated
            .saturating_add(at_rail(&sample.counts));
        self.samples += 1;
        let electrodes = self.front_end.push(sample)?;
        let (plane, clipped) = Quantiser::plane(&electrodes);
        self.parts[part].clipped += clipped;
        let output = self.encoder.push(&plane);
        self.steps += 1;
        let losses = self.parts;
        if self.steps.is_multiple_of(HOP as u64) {
            self.parts[self.current_part()] = Losses::default();
        }
        let output = output?;
        let first_sample = (self.steps - STEPS as u64) * u64::from(DECIMATION);
        Some(Code {
            window: output.window,
            first_sample,
            clipped: losses.iter().map(|part| part.clipped).sum(),
            saturated: losses
                .iter()
                .fold(0, |sum, part| sum.saturating_add(part.saturated)),
            settling: first_sample < self.settling_samples,
            values: output.values,
        })
    }

    /// Samples pushed since the start.
    pub const fn samples(&self) -> u64 {
        self.samples
    }

    /// The part of a window that the next sample belongs to.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a remainder below the number of parts"
    )]
    fn current_part(&self) -> usize {
        (self.steps / HOP as u64 % OPEN as u64) as usize
    }
}

/// Electrodes of a sample at the ADC's rail.
fn at_rail(counts: &[i32; CHANNELS]) -> u16 {
    counts[..ELECTRODES]
        .iter()
        .map(|&count| u16::from(!(-Sample::MAX..Sample::MAX).contains(&count)))
        .sum()
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    fn codes(samples: impl IntoIterator<Item = Sample>) -> Vec<Code> {
        let mut pipeline = Pipeline::new(Mains::Hz50);
        samples
            .into_iter()
            .filter_map(|sample| pipeline.push(&sample))
            .collect()
    }

    #[test]
    fn a_code_comes_every_hop_and_names_its_first_sample() {
        let codes = codes((0..512).map(|_| Sample::default()));
        let hop = HOP as u64 * u64::from(DECIMATION);
        for (index, code) in codes.iter().enumerate() {
            assert_eq!(u64::from(code.window), index as u64);
            assert_eq!(code.first_sample, index as u64 * hop);
        }
        assert_eq!(
            codes.len(),
            1 + (512 / usize::from(DECIMATION) - STEPS) / HOP
        );
    }

    #[test]
    fn an_electrode_at_the_rail_is_counted_in_every_window_that_holds_it() {
        let railed = |index: usize| {
            let mut sample = Sample::default();
            // One sample in the eleventh hop: windows 9 (second half) and 10 (first half).
            if index == 10 * HOP * usize::from(DECIMATION) + 5 {
                sample.counts[4] = -Sample::MAX - 1;
                sample.counts[CHANNELS - 1] = Sample::MAX;
            }
            sample
        };
        let saturated: Vec<u32> = codes((0..1_024).map(railed))
            .iter()
            .filter(|code| code.saturated == 1)
            .map(|code| code.window)
            .collect();
        assert_eq!(saturated, if OPEN == 2 { &[9, 10][..] } else { &[5][..] });
    }

    #[test]
    fn codes_are_marked_until_the_filters_have_settled() {
        let codes = codes((0..10_240).map(|_| Sample::default()));
        let settled = u64::from(Mains::Hz50.filter().settling_samples);
        assert!(
            codes
                .iter()
                .all(|code| code.settling == (code.first_sample < settled))
        );
        assert!(codes.iter().any(|code| !code.settling));
    }
}
