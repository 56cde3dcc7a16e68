//! Resampler from the ADC's rate to the step rate, for any description.

use crate::error::TrainerError;
use artifact::Description;
use model_gen::ResamplerTable;
use std::collections::VecDeque;

/// Resampler with the same output bits as the device's, but with sizes that are known only at run time.
pub(crate) struct Resampler {
    table: ResamplerTable,
    /// The newest filtered samples, as many as a phase has taps, newest first.
    newest: VecDeque<Vec<i32>>,
    /// Time from the next input sample to the next output, in units of 1 / phases of a sample period.
    ahead: usize,
}

impl Resampler {
    /// Creates a resampler whose previous samples are all 0.
    pub(crate) fn new(description: &Description) -> Result<Self, TrainerError> {
        let table = ResamplerTable::new(
            description.filters.decimation,
            description.adc.rate_hz,
            description.window.rate_hz,
            description.montage.electrodes.len(),
        )
        .map_err(TrainerError::Resampler)?;
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
            // The sum has 30 fraction bits from the Q2.30 taps; they are removed by rounding half up.
            i32::try_from((sum + (1 << 29)) >> 30).expect("model-gen proves the head room")
        };
        Some((0..electrodes).map(output).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use artifact::Decimation;
    use fixed_dsp::{Cascade, Coefficient, Section};
    use pipeline::{FrontEnd, Sample};

    #[test]
    fn the_outputs_equal_the_device_s_bit_for_bit_at_a_rational_ratio() {
        let mut description = testing::description();
        description.adc.rate_hz = 500;
        description.filters.decimation = Decimation::Fir;
        let mut resampler = Resampler::new(&description).expect("a usual rate");
        let on_device = fixed_dsp::Resampler {
            down: resampler.table.down,
            taps: std::array::from_fn::<_, 32, _>(|phase| {
                std::array::from_fn::<_, 64, _>(|age| resampler.table.taps[phase][age])
            }),
        };
        let every = fixed_dsp::Resampler::every(1);
        // An arbitrary high-pass before both resamplers, because `FrontEnd` needs a cascade.
        let high_pass = Cascade {
            sections: [Section::HighPass {
                a1: Coefficient::nearest(1.5),
                a2: Coefficient::nearest(-0.5625),
            }],
        };
        let mut filters = FrontEnd::new(high_pass, &every);
        let mut device = FrontEnd::new(high_pass, &on_device);
        let mut outputs = 0;
        for n in 0..2_000_i32 {
            let counts = std::array::from_fn(|channel| {
                let channel = i32::try_from(channel).expect("64 channels");
                (n * n * 313 + channel * 977) % 100_003 - 50_000
            });
            let expected = device
                .filter_sample(&Sample { counts })
                .map(|(now, _)| now.to_vec());
            let found = filters
                .filter_sample(&Sample { counts })
                .and_then(|(now, _)| resampler.resample(now.to_vec()));
            assert_eq!(found, expected, "sample {n}");
            outputs += usize::from(found.is_some());
        }
        assert_eq!(outputs, 2_000 * 128 / 500);
    }
}
