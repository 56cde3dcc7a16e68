//! The interface of all filters: filters with coefficients known at run time only, and filters
//! whose coefficients are compiled into the code.

use core::marker::PhantomData;

use crate::{
    cascade::{Cascade, CascadeState},
    section::Fractions,
};

/// Number of consecutive samples of one channel that are filtered together, so that the channel's
/// state is loaded and stored only once for them.
pub const BLOCK: usize = 4;

/// A filter that several channels share; each channel has a state of its own. Output samples have
/// the unit and format of the input samples. Overflow wraps: see [`Cascade`].
pub trait Filter {
    /// Memory of the filter for one channel.
    type State: Copy;
    /// State after a long input of zeros.
    const REST: Self::State;

    /// Filters one sample of one channel.
    fn apply(&self, state: &mut Self::State, x: i32) -> i32;

    /// Filters [`BLOCK`] consecutive samples of each channel in place, with the same bits as
    /// [`BLOCK`] calls of [`Self::apply`].
    ///
    /// `blocks[channel]` belongs to `states[channel]`. If one slice is longer, its excess elements
    /// are unchanged.
    fn apply_blocks(&self, states: &mut [Self::State], blocks: &mut [[i32; BLOCK]]);
}

/// A cascade is a filter whose coefficients are known at run time only.
impl<const N: usize> Filter for Cascade<N> {
    type State = CascadeState<N>;
    const REST: Self::State = CascadeState::REST;

    #[inline]
    fn apply(&self, state: &mut Self::State, x: i32) -> i32 {
        let [y] = self.apply_block(&self.fractions(), state, [x]);
        y
    }

    fn apply_blocks(&self, states: &mut [Self::State], blocks: &mut [[i32; BLOCK]]) {
        let fractions = self.fractions();
        for (state, block) in states.iter_mut().zip(blocks) {
            *block = self.apply_block(&fractions, state, *block);
        }
    }
}

/// A cascade of `N` sections that is known at compile time.
pub trait Design<const N: usize> {
    /// The sections of the cascade, with their coefficients.
    const CASCADE: Cascade<N>;
}

/// The filter of a [`Design`]: code for this one cascade, with the section types and the integer
/// parts of the coefficients built in. Only the fractions are loaded from memory.
///
/// Filtered in blocks, six sections take 56 simulated instructions per sample and channel; as a
/// [`Cascade`], they take 90 to 108, depending on their types (`cargo xtask bench filters`).
#[derive(Clone, Copy, Debug, Default)]
pub struct Compiled<D, const N: usize>(PhantomData<D>);

impl<D, const N: usize> Compiled<D, N> {
    /// Returns the filter, which has no data.
    pub const fn new() -> Self {
        Self(PhantomData)
    }
}

impl<D: Design<N>, const N: usize> Compiled<D, N> {
    const FRACTIONS: &'static [Fractions; N] = &D::CASCADE.fractions();

    /// Returns the fractions of all coefficients, which `black_box` hides from the optimiser. As
    /// constants in code, each fraction would take two instructions per channel instead of one
    /// load.
    #[inline(always)]
    fn fractions() -> &'static [Fractions; N] {
        core::hint::black_box(Self::FRACTIONS)
    }
}

impl<D: Design<N>, const N: usize> Filter for Compiled<D, N> {
    type State = CascadeState<N>;
    const REST: Self::State = CascadeState::REST;

    #[inline]
    fn apply(&self, state: &mut Self::State, x: i32) -> i32 {
        let [y] = D::CASCADE.apply_block(Self::fractions(), state, [x]);
        y
    }

    fn apply_blocks(&self, states: &mut [Self::State], blocks: &mut [[i32; BLOCK]]) {
        let fractions = Self::fractions();
        for (state, block) in states.iter_mut().zip(blocks) {
            *block = D::CASCADE.apply_block(fractions, state, *block);
        }
    }
}
