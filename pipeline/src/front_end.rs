//! Filters and decimation: from samples to electrodes at the encoder's rate.

use fixed_dsp::{Cascade, CascadeState, Decimator};
use model::{ELECTRODES, GUARD_BITS, SECTIONS};

use crate::Sample;

/// All electrodes at one time step: counts x 2^4 (Q28.4), |x| < 2^31; the index is the electrode.
pub type Electrodes = [i32; ELECTRODES];

/// Filters every electrode and keeps every n-th time step.
#[derive(Clone, Debug)]
pub struct FrontEnd {
    cascade: Cascade<SECTIONS>,
    states: [CascadeState<SECTIONS>; ELECTRODES],
    decimator: Decimator,
}

impl FrontEnd {
    /// A front end at rest that runs `cascade` and keeps the first and then every `decimation`-th
    /// sample.
    ///
    /// # Panics
    /// When `decimation` is 0.
    pub const fn new(cascade: Cascade<SECTIONS>, decimation: u8) -> Self {
        Self {
            cascade,
            states: [CascadeState::REST; ELECTRODES],
            decimator: Decimator::new(decimation),
        }
    }

    /// Filters one sample; every n-th call gives the electrodes.
    #[inline]
    pub fn push(&mut self, sample: &Sample) -> Option<Electrodes> {
        debug_assert!(
            sample
                .counts
                .iter()
                .all(|count| (-Sample::MAX - 1..=Sample::MAX).contains(count)),
            "counts have 24 bits: the filters' head room is proven for no more"
        );
        let mut filtered = [0; ELECTRODES];
        for ((out, state), &count) in filtered
            .iter_mut()
            .zip(&mut self.states)
            .zip(&sample.counts)
        {
            *out = self.cascade.step(state, count << GUARD_BITS);
        }
        self.decimator.keeps_next().then_some(filtered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mains;

    fn front_end() -> FrontEnd {
        FrontEnd::new(Mains::Hz50.filter().cascade, model::DECIMATION)
    }

    #[test]
    fn every_fourth_sample_gives_electrodes_the_first_included() {
        let mut front_end = front_end();
        let given = core::array::from_fn(|_| front_end.push(&Sample::default()).is_some());
        assert_eq!(
            given,
            [true, false, false, false, true, false, false, false]
        );
    }

    #[test]
    fn full_scale_telegraph_input_never_wraps() {
        // The sign pattern of the reversed impulse response is the input that reaches the L1 norm:
        // no other is worse. The f64 twin tells what the output must be.
        let sections = Mains::Hz50.filter().cascade.sections;
        let impulse = core::iter::once(1.0)
            .chain(core::iter::repeat(0.0))
            .take(20_000);
        let response: std::vec::Vec<f64> =
            model_gen::response::filter(&sections, impulse).collect();
        let telegraph: std::vec::Vec<i32> = response
            .iter()
            .rev()
            .map(|h| {
                if *h < 0.0 {
                    -Sample::MAX - 1
                } else {
                    Sample::MAX
                }
            })
            .collect();
        let input = telegraph
            .iter()
            .map(|&count| f64::from(count << GUARD_BITS));
        let expected = model_gen::response::filter(&sections, input);
        let mut state = CascadeState::REST;
        let cascade = Cascade { sections };
        let mut largest = 0.0_f64;
        for (&count, expected) in telegraph.iter().zip(expected) {
            let y = f64::from(cascade.step(&mut state, count << GUARD_BITS));
            // Shaped rounding noise of six sections, no wrap: measured 11 steps.
            assert!((y - expected).abs() < 64.0, "{y} instead of {expected}");
            largest = largest.max(y.abs());
        }
        // The bound is reached, so the test does exercise the worst case.
        assert!(largest > 0.99 * response.iter().map(|h| h.abs()).sum::<f64>() * 134_217_720.0);
    }

    #[test]
    fn an_electrode_offset_of_full_scale_decays_below_one_count() {
        let mut front_end = front_end();
        let sample = Sample {
            counts: [Sample::MAX; model::CHANNELS],
        };
        let electrodes: std::vec::Vec<_> = (0..81_920)
            .filter_map(|_| front_end.push(&sample))
            .collect();
        let last_second = &electrodes[electrodes.len() - 128..];
        // What stays is the noise shaping's own cycle: measured 8 steps of Q28.4, half a count.
        assert!(
            last_second
                .iter()
                .flatten()
                .all(|v| v.abs() < 1 << GUARD_BITS)
        );
    }
}
