//! All channels of one position, which a PC transforms together.

use core::{
    array::from_fn,
    ops::{Add, Sub},
};

use super::tile::Lanes;
use crate::pair::Pair;

/// The channels of one position, as `PAIRS` pairs. The compiler turns operations on them into SIMD
/// instructions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channels<const PAIRS: usize>([[i16; 2]; PAIRS]);

impl<const PAIRS: usize> Channels<PAIRS> {
    /// All channels are 0.
    pub(super) const ZERO: Self = Self([[0; 2]; PAIRS]);

    /// Reads the channels of a position from a plane `[pair of channels][position]` with
    /// `positions` positions; the slice `plane` starts at the position.
    #[inline(always)]
    pub(super) fn gather(plane: &[Pair], positions: usize) -> Self {
        let plane = &plane[..=(PAIRS - 1) * positions];
        Self(from_fn(|pair| plane[pair * positions].get()))
    }

    /// Writes the channels to `pairs`.
    #[inline(always)]
    pub(super) fn store(self, pairs: &mut [Pair]) {
        for (pair, channels) in pairs[..PAIRS].iter_mut().zip(self.0) {
            *pair = Pair::new(channels);
        }
    }

    #[inline(always)]
    fn map2(self, other: Self, operation: impl Fn(i16, i16) -> i16) -> Self {
        let mut result = self;
        for (pair, other) in result.0.iter_mut().zip(other.0) {
            for (channel, other) in pair.iter_mut().zip(other) {
                *channel = operation(*channel, other);
            }
        }
        result
    }
}

impl<const PAIRS: usize> Lanes for Channels<PAIRS> {
    #[inline(always)]
    fn quadrupled(self) -> Self {
        self.map2(self, |channel, _| {
            debug_assert!((0..1 << 13).contains(&channel), "four times {channel}");
            channel << 2
        })
    }
}

impl<const PAIRS: usize> Add for Channels<PAIRS> {
    type Output = Self;

    /// Adds channel by channel, wrapping.
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.map2(other, i16::wrapping_add)
    }
}

impl<const PAIRS: usize> Sub for Channels<PAIRS> {
    type Output = Self;

    /// Subtracts channel by channel, wrapping.
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.map2(other, i16::wrapping_sub)
    }
}
