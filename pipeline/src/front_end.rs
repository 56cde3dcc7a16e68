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
    use std::{f64::consts::PI, vec::Vec};

    use fixed_dsp::Section;

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

    /// Sections up to and including `last`.
    fn prefix(mains: Mains, last: usize) -> Vec<Section> {
        mains.filter().cascade.sections[..=last].to_vec()
    }

    /// The full-scale input that drives the output of the last of `sections` furthest: the sign
    /// pattern of the reversed impulse response. No other input reaches the L1 norm.
    fn worst_telegraph(sections: &[Section]) -> Vec<i32> {
        let impulse = core::iter::once(1.0)
            .chain(core::iter::repeat(0.0))
            .take(20_000);
        let response: Vec<f64> = model_gen::response::filter(sections, impulse).collect();
        let rail = |h: &f64| {
            if *h < 0.0 {
                -Sample::MAX - 1
            } else {
                Sample::MAX
            }
        };
        response.iter().rev().map(rail).collect()
    }

    #[test]
    fn the_worst_full_scale_input_of_every_section_never_wraps() {
        for mains in [Mains::Hz50, Mains::Hz60] {
            let cascade = mains.filter().cascade;
            for last in 0..SECTIONS {
                let telegraph = worst_telegraph(&prefix(mains, last));
                let input = telegraph
                    .iter()
                    .map(|&count| f64::from(count << GUARD_BITS));
                let expected = model_gen::response::filter(&cascade.sections, input);
                let mut state = CascadeState::REST;
                for (&count, expected) in telegraph.iter().zip(expected) {
                    let y = f64::from(cascade.step(&mut state, count << GUARD_BITS));
                    // Shaped rounding noise of six sections (measured: 15 steps); a wrap anywhere
                    // would be off by millions.
                    assert!((y - expected).abs() < 128.0, "{y} instead of {expected}");
                }
            }
        }
    }

    #[test]
    fn the_output_s_worst_input_reaches_the_proven_gain() {
        let sections = prefix(Mains::Hz50, SECTIONS - 1);
        let gains = model_gen::headroom::prove(&sections).expect("proven at build time too");
        let proven = gains.last().expect("a cascade has nodes").gain;
        let cascade = Mains::Hz50.filter().cascade;
        let mut state = CascadeState::REST;
        let largest = worst_telegraph(&sections)
            .iter()
            .map(|&count| cascade.step(&mut state, count << GUARD_BITS).unsigned_abs())
            .max();
        let reached = f64::from(largest.expect("an input")) / f64::from(1 << 27);
        assert!(
            (reached / proven - 1.0).abs() < 1e-3,
            "{reached} of {proven}"
        );
    }

    #[test]
    fn the_stated_group_delay_is_that_of_an_alpha_burst() {
        for mains in [Mains::Hz50, Mains::Hz60] {
            // 10 Hz under a Hann window of 4 s, 50 uV; the envelope's centre of mass is delayed.
            let rate = f64::from(model::ADC_RATE_HZ);
            let burst = |n: f64| {
                let t = (n / rate - 1.0) / 4.0;
                let hann = if (0.0..1.0).contains(&t) {
                    (PI * t).sin().powi(2)
                } else {
                    0.0
                };
                50_000.0 / f64::from(model::LSB_NV) * hann * (2.0 * PI * 10.0 * n / rate).sin()
            };
            let cascade = mains.filter().cascade;
            let mut state = CascadeState::REST;
            let (mut before, mut after) = ([0.0; 2], [0.0; 2]);
            for n in 0..(8 * u32::from(model::ADC_RATE_HZ)) {
                let x = burst(n.into());
                #[expect(clippy::cast_possible_truncation, reason = "2,237 counts at most")]
                let y = f64::from(cascade.step(&mut state, (x.round() as i32) << GUARD_BITS));
                for (sums, value) in [(&mut before, x), (&mut after, y)] {
                    sums[0] += value * value;
                    sums[1] += value * value * f64::from(n);
                }
            }
            let delay_us = (after[1] / after[0] - before[1] / before[0]) / rate * 1e6;
            let stated = f64::from(mains.filter().group_delay_us);
            // The delay bends a little over the burst's band; measured 9 us apart.
            assert!(
                (delay_us - stated).abs() < 50.0,
                "{delay_us} us instead of {stated}"
            );
        }
    }

    #[test]
    fn an_electrode_offset_of_full_scale_decays_below_one_count() {
        let mut front_end = front_end();
        let sample = Sample {
            counts: [Sample::MAX; model::CHANNELS],
        };
        let electrodes: Vec<_> = (0..81_920)
            .filter_map(|_| front_end.push(&sample))
            .collect();
        let last_second = &electrodes[electrodes.len() - 128..];
        // What stays is the noise shaping's own cycle: measured 10 steps of Q28.4.
        assert!(
            last_second
                .iter()
                .flatten()
                .all(|v| v.abs() < 1 << GUARD_BITS)
        );
    }
}
