//! The mains frequency that the notch removes, and the filters for it.

use fixed_dsp::{BLOCK, CascadeState, Compiled, Filter};
use model::{MAINS_50, MAINS_60, MainsFilter, SECTIONS};

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

    /// Returns coefficients and delays of the filters for this mains frequency.
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
    use super::*;

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
