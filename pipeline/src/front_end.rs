//! Filters and resampler: from samples to electrodes at the encoder's rate.

use fixed_dsp::{BLOCK, DelayLine, Filter, Position, Resampler};
use model::{ELECTRODES, GUARD_BITS};

use crate::Sample;

/// All electrodes at one time step: counts x 2^5 (Q27.5), |x| < 2^31; the index is the electrode.
pub type Electrodes = [i32; ELECTRODES];

/// Filters every electrode and brings it to a lower rate.
///
/// Samples wait until an output needs them or there are [`BLOCK`] of them, which the filters take
/// together for half the price; no output is later for it, and the bits are the same.
#[derive(Clone, Debug)]
pub struct FrontEnd<'r, F: Filter, const PHASES: usize, const TAPS: usize> {
    filter: F,
    states: [F::State; ELECTRODES],
    /// Samples of each electrode that wait for the filters, the earliest first.
    waiting: [[i32; BLOCK]; ELECTRODES],
    /// How many, 0..BLOCK.
    count: usize,
    resampler: &'r Resampler<PHASES, TAPS>,
    position: Position,
    line: DelayLine<ELECTRODES, TAPS>,
}

impl<'r, F: Filter, const PHASES: usize, const TAPS: usize> FrontEnd<'r, F, PHASES, TAPS> {
    /// A front end at rest.
    pub const fn new(filter: F, resampler: &'r Resampler<PHASES, TAPS>) -> Self {
        Self {
            filter,
            states: [F::REST; ELECTRODES],
            waiting: [[0; BLOCK]; ELECTRODES],
            count: 0,
            resampler,
            position: Position::START,
            line: DelayLine::SILENCE,
        }
    }

    /// Forgets the signal, in place, and goes to rest with this filter.
    pub fn restart(&mut self, filter: F) {
        self.filter = filter;
        self.states.fill(F::REST);
        self.count = 0;
        self.position = Position::START;
        self.line = DelayLine::SILENCE;
    }

    /// Takes one sample. When an output of the resampler is due with it, gives the electrodes and
    /// the output's phase: how much later than the sample it stands, in parts (1 / `PHASES`) of a
    /// sample.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Option<(Electrodes, usize)> {
        debug_assert!(
            sample
                .counts
                .iter()
                .all(|count| (-Sample::MAX - 1..=Sample::MAX).contains(count)),
            "counts have 24 bits: the filters' head room is proven for no more"
        );
        for (waiting, &count) in self.waiting.iter_mut().zip(&sample.counts) {
            waiting[self.count % BLOCK] = count << GUARD_BITS;
        }
        self.count += 1;
        let due = self.resampler.advance(&mut self.position);
        if due.is_some() || self.count == BLOCK {
            self.filter();
        }
        due.map(|phase| (self.resampler.outputs(phase, &self.line), phase))
    }

    /// Filters what waits.
    fn filter(&mut self) {
        // Never more; said again so that the compiler knows.
        let count = self.count.min(BLOCK);
        if count == BLOCK {
            self.filter.blocks(&mut self.states, &mut self.waiting);
        } else {
            for (state, waiting) in self.states.iter_mut().zip(&mut self.waiting) {
                for x in &mut waiting[..count] {
                    *x = self.filter.step(state, *x);
                }
            }
        }
        // What would have left the line again is not put in.
        for index in count.saturating_sub(TAPS)..count {
            self.line
                .push(self.waiting.iter().map(|block| block[index % BLOCK]));
        }
        self.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::Mains;

    /// Any 24-bit counts, different on every electrode.
    fn noise(length: usize) -> Vec<Sample> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.cast_signed() >> 8
        };
        let sample = |_| Sample {
            counts: core::array::from_fn(|_| next()),
        };
        (0..length).map(sample).collect()
    }

    #[test]
    fn every_fourth_sample_gives_electrodes_the_first_included() {
        let resampler = Resampler::every(4);
        let mut front_end = FrontEnd::new(Mains::Hz50, &resampler);
        let given = core::array::from_fn(|_| front_end.push(&Sample::default()).is_some());
        assert_eq!(
            given,
            [true, false, false, false, true, false, false, false]
        );
    }

    #[test]
    fn waiting_for_others_changes_no_bit_of_an_output() {
        let samples = noise(1_000);
        let every = Resampler::every(1);
        let mut sample_by_sample = FrontEnd::new(Mains::Hz60, &every);
        let expected: Vec<Electrodes> = samples
            .iter()
            .filter_map(|sample| Some(sample_by_sample.push(sample)?.0))
            .collect();
        assert_eq!(expected.len(), samples.len());
        // Blocks of 3; of 4; of 4, 4 and 1; of 4 and 3.
        for down in [3, 4, 9, 7] {
            let resampler = Resampler::every(down);
            let mut front_end = FrontEnd::new(Mains::Hz60, &resampler);
            let mut outputs = 0;
            for (index, sample) in samples.iter().enumerate() {
                if let Some((electrodes, phase)) = front_end.push(sample) {
                    assert_eq!((electrodes, phase), (expected[index], 0));
                    outputs += 1;
                }
            }
            assert_eq!(outputs, samples.len().div_ceil(down.into()));
        }
    }

    #[test]
    fn the_resampler_sees_every_filtered_sample_in_its_order() {
        // 2 outputs for 5 samples, each a sum with the weights 1, 1/2 or 1/4, 1/8 of the newest two.
        let unity = Resampler::<1, 1>::UNITY;
        let resampler = Resampler {
            down: 5,
            taps: [[unity, unity / 2], [unity / 4, unity / 8]],
        };
        let samples = noise(100);
        let every = Resampler::every(1);
        let mut sample_by_sample = FrontEnd::new(Mains::Hz50, &every);
        let mut front_end = FrontEnd::new(Mains::Hz50, &resampler);
        let mut before = [0; ELECTRODES];
        let mut phases = Vec::new();
        for sample in &samples {
            let (filtered, _) = sample_by_sample.push(sample).expect("one for each");
            if let Some((electrodes, phase)) = front_end.push(sample) {
                for (electrode, &y) in electrodes.iter().enumerate() {
                    let scaled =
                        8 * i64::from(filtered[electrode]) + 4 * i64::from(before[electrode]);
                    let divisor = [8, 32][phase];
                    assert_eq!(i64::from(y), (scaled + divisor / 2).div_euclid(divisor));
                }
                phases.push(phase);
            }
            before = filtered;
        }
        assert_eq!(phases[..4], [0, 1, 0, 1]);
    }
}
