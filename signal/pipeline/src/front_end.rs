//! Filters and resampler for all electrodes, with the filters of each mains frequency.

use fixed_dsp::{BLOCK, CascadeState, Compiled, DelayLine, Filter, Position, Resampler};
use model::{ELECTRODES, GUARD_BITS, MAINS_50, MAINS_60, MainsFilter, SECTIONS};

use crate::sample::Sample;

/// All electrodes at one time step: counts x 2^5 (Q27.5), |x| < 2^31; the index is the electrode.
pub type Electrodes = [i32; ELECTRODES];

/// Filters and resamples every electrode.
///
/// Samples are buffered until an output is due or [`BLOCK`] of them wait, because a sample takes
/// half as many instructions in a block as alone. Buffering delays no output and changes no bit.
#[derive(Clone, Debug)]
pub struct FrontEnd<'r, F: Filter, const PHASES: usize, const TAPS: usize> {
    filter: F,
    states: [F::State; ELECTRODES],
    /// Buffered samples of each electrode, earliest first.
    waiting: [[i32; BLOCK]; ELECTRODES],
    /// Number of buffered samples, 0..BLOCK.
    count: usize,
    resampler: &'r Resampler<PHASES, TAPS>,
    position: Position,
    line: DelayLine<ELECTRODES, TAPS>,
}

impl<'r, F: Filter, const PHASES: usize, const TAPS: usize> FrontEnd<'r, F, PHASES, TAPS> {
    /// Creates a front end at rest.
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

    /// Resets the front end in place, with another filter.
    pub fn restart(&mut self, filter: F) {
        self.filter = filter;
        self.states.fill(F::REST);
        self.count = 0;
        self.position = Position::START;
        self.line = DelayLine::SILENCE;
    }

    /// Filters one sample. If an output of the resampler is due with this sample, returns the
    /// electrodes and the output's phase: the time from the sample to the output, in units of 1 /
    /// `PHASES` of the time between two samples.
    #[inline]
    pub fn filter_sample(&mut self, sample: &Sample) -> Option<(Electrodes, usize)> {
        debug_assert!(
            sample.counts.iter().all(|count| (-Sample::MAX - 1..=Sample::MAX).contains(count)),
            "the filters' head room is proven for counts of 24 bits only"
        );
        for (waiting, &count) in self.waiting.iter_mut().zip(&sample.counts) {
            waiting[self.count % BLOCK] = count << GUARD_BITS;
        }
        self.count += 1;
        let due = self.resampler.advance(&mut self.position);
        if due.is_some() || self.count == BLOCK {
            self.filter_waiting();
        }
        due.map(|phase| (self.resampler.outputs(phase, &self.line), phase))
    }

    /// Filters the buffered samples and moves them to the delay line.
    fn filter_waiting(&mut self) {
        // `count` is at most `BLOCK`; `min` lets the compiler drop the bounds checks.
        let count = self.count.min(BLOCK);
        if count == BLOCK {
            self.filter.apply_blocks(&mut self.states, &mut self.waiting);
        } else {
            for (state, waiting) in self.states.iter_mut().zip(&mut self.waiting) {
                for x in &mut waiting[..count] {
                    *x = self.filter.apply(state, *x);
                }
            }
        }
        // Skip samples that newer samples of this block would push out of the delay line.
        for index in count.saturating_sub(TAPS)..count {
            self.line.push(self.waiting.iter().map(|block| block[index % BLOCK]));
        }
        self.count = 0;
    }
}

/// Mains frequency, set at start. As a [`Filter`], it applies the filters for this frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mains {
    /// 50 Hz: Europe, most of Africa, Asia and Australia.
    #[default]
    Hz50,
    /// 60 Hz: most of the Americas and parts of Asia.
    Hz60,
}

impl Mains {
    /// Returns the mains frequency of `hz` Hz, if the model has filters for it.
    pub const fn from_hz(hz: u8) -> Option<Self> {
        match hz {
            50 => Some(Self::Hz50),
            60 => Some(Self::Hz60),
            _ => None,
        }
    }

    /// Returns the filters for this mains frequency: coefficients and delays.
    pub const fn filter(self) -> &'static MainsFilter {
        match self {
            Self::Hz50 => &MAINS_50,
            Self::Hz60 => &MAINS_60,
        }
    }
}

impl Filter for Mains {
    type State = CascadeState<SECTIONS>;
    const REST: Self::State = CascadeState::REST;

    #[inline]
    fn apply(&self, state: &mut Self::State, x: i32) -> i32 {
        match self {
            Self::Hz50 => Compiled::<model::Mains50, SECTIONS>::new().apply(state, x),
            Self::Hz60 => Compiled::<model::Mains60, SECTIONS>::new().apply(state, x),
        }
    }

    fn apply_blocks(&self, states: &mut [Self::State], blocks: &mut [[i32; BLOCK]]) {
        match self {
            Self::Hz50 => Compiled::<model::Mains50, SECTIONS>::new().apply_blocks(states, blocks),
            Self::Hz60 => Compiled::<model::Mains60, SECTIONS>::new().apply_blocks(states, blocks),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Returns pseudo-random 24-bit counts, different on every electrode.
    fn noise(length: usize) -> Vec<Sample> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.cast_signed() >> 8
        };
        let sample = |_| Sample { counts: core::array::from_fn(|_| next()) };
        (0..length).map(sample).collect()
    }

    #[test]
    fn buffering_samples_changes_no_bit_of_an_output() {
        let samples = noise(1_000);
        let every = Resampler::every(1);
        let mut sample_by_sample = FrontEnd::new(Mains::Hz60, &every);
        let expected: Vec<Electrodes> = samples
            .iter()
            .filter_map(|sample| Some(sample_by_sample.filter_sample(sample)?.0))
            .collect();
        assert_eq!(expected.len(), samples.len());
        // A block ends at each output, and after 4 samples. With an output every 3, 4, 9 or 7
        // samples, the blocks between two outputs have 3, 4, 4 + 4 + 1 or 4 + 3 samples.
        for down in [3, 4, 9, 7] {
            let resampler = Resampler::every(down);
            let mut front_end = FrontEnd::new(Mains::Hz60, &resampler);
            let mut outputs = 0;
            for (index, sample) in samples.iter().enumerate() {
                if let Some((electrodes, phase)) = front_end.filter_sample(sample) {
                    assert_eq!((electrodes, phase), (expected[index], 0));
                    outputs += 1;
                }
            }
            assert_eq!(outputs, samples.len().div_ceil(down.into()));
        }
    }

    #[test]
    fn the_resampler_reads_every_filtered_sample_in_order() {
        // Two outputs for five samples. The weights of the two newest samples are 1 and 1/2 in
        // phase 0, and 1/4 and 1/8 in phase 1.
        let unity = Resampler::<1, 1>::UNITY;
        let resampler = Resampler { down: 5, taps: [[unity, unity / 2], [unity / 4, unity / 8]] };
        let samples = noise(100);
        let every = Resampler::every(1);
        let mut sample_by_sample = FrontEnd::new(Mains::Hz50, &every);
        let mut front_end = FrontEnd::new(Mains::Hz50, &resampler);
        let mut before = [0; ELECTRODES];
        let mut phases = Vec::new();
        for sample in &samples {
            let (filtered, _) = sample_by_sample.filter_sample(sample).expect("one for each");
            if let Some((electrodes, phase)) = front_end.filter_sample(sample) {
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

    #[test]
    fn the_compiled_filter_equals_the_cascade_of_its_mains_frequency() {
        for mains in [Mains::Hz50, Mains::Hz60] {
            assert_eq!(Mains::from_hz(mains.filter().mains_hz), Some(mains));
            let (mut compiled, mut cascade) = (CascadeState::REST, CascadeState::REST);
            for x in (0..500).map(|n| (n * 7_919) % 100_003) {
                let expected = mains.filter().cascade.apply(&mut cascade, x);
                assert_eq!(mains.apply(&mut compiled, x), expected);
            }
        }
        assert_eq!(Mains::from_hz(55), None);
    }
}
