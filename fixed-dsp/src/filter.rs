//! What filters a channel, whether its coefficients are known to the compiler or not.

use core::marker::PhantomData;

use crate::{Cascade, CascadeState, section::Remainders};

/// Samples of one channel that are filtered together: a quarter of the loads and stores of state.
pub const BLOCK: usize = 4;

/// Something that filters channels, each with a state of its own.
///
/// Samples are in and out in the same unit and format. Wraps on overflow: see [`Cascade`].
pub trait Filter {
    /// What one channel remembers.
    type State: Copy;
    /// The state at rest: all samples so far were zero.
    const REST: Self::State;

    /// Filters one sample of one channel.
    fn step(&self, state: &mut Self::State, x: i32) -> i32;

    /// Filters [`BLOCK`] consecutive samples of each channel in place; the same bits as as many
    /// steps. `blocks[channel]` belongs to `states[channel]`; of the longer slice the rest is left
    /// alone.
    fn blocks(&self, states: &mut [Self::State], blocks: &mut [[i32; BLOCK]]);
}

/// Coefficients known at run time.
impl<const N: usize> Filter for Cascade<N> {
    type State = CascadeState<N>;
    const REST: Self::State = CascadeState::REST;

    #[inline]
    fn step(&self, state: &mut Self::State, x: i32) -> i32 {
        let [y] = self.run(&self.remainders(), state, [x]);
        y
    }

    fn blocks(&self, states: &mut [Self::State], blocks: &mut [[i32; BLOCK]]) {
        let remainders = self.remainders();
        for (state, block) in states.iter_mut().zip(blocks) {
            *block = self.run(&remainders, state, *block);
        }
    }
}

/// A cascade of `N` sections that the compiler knows.
pub trait Design<const N: usize> {
    /// The cascade.
    const CASCADE: Cascade<N>;
}

/// The filter of a [`Design`]: code made for this one cascade, with shapes and integers built in and
/// only the remainders loaded. About half of the instructions of [`Cascade`] itself: 56 instead of 90
/// to 108, whatever its six sections (`cargo xtask bench filters`).
#[derive(Clone, Copy, Debug, Default)]
pub struct Compiled<D, const N: usize>(PhantomData<D>);

impl<D, const N: usize> Compiled<D, N> {
    /// The filter.
    pub const fn new() -> Self {
        Self(PhantomData)
    }
}

impl<D: Design<N>, const N: usize> Compiled<D, N> {
    const REMAINDERS: &'static [Remainders; N] = &D::CASCADE.remainders();

    /// The remainders as data: constants in the code would take two instructions each, for every
    /// channel, where one load does.
    #[inline(always)]
    fn remainders() -> &'static [Remainders; N] {
        core::hint::black_box(Self::REMAINDERS)
    }
}

impl<D: Design<N>, const N: usize> Filter for Compiled<D, N> {
    type State = CascadeState<N>;
    const REST: Self::State = CascadeState::REST;

    #[inline]
    fn step(&self, state: &mut Self::State, x: i32) -> i32 {
        let [y] = D::CASCADE.run(Self::remainders(), state, [x]);
        y
    }

    fn blocks(&self, states: &mut [Self::State], blocks: &mut [[i32; BLOCK]]) {
        let remainders = Self::remainders();
        for (state, block) in states.iter_mut().zip(blocks) {
            *block = D::CASCADE.run(remainders, state, *block);
        }
    }
}
