//! The windows that are open at the same time.

use int8_nn::{Pair, requantise_sum};
use model::{
    CODE, CODE_FORMAT, ELECTRODE_PAIRS, FC_PAIRS, FC_PIECES, Network, POOLED_PAIRS, SHORTCUT_PAIRS,
};

use crate::{Code, CodeValues, Step};

/// Windows that a time step can belong to, with the smallest hop.
pub(crate) const OPEN: usize = 2;

/// Sums of one window that is not complete yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenWindow {
    fc: [i32; CODE],
    shortcut: [i32; CODE],
    first_sample: u64,
    offset_us: u16,
    clipped: u16,
    saturated: u64,
    settling: bool,
}

impl OpenWindow {
    /// No window.
    pub(crate) const EMPTY: Self = Self {
        fc: [0; CODE],
        shortcut: [0; CODE],
        first_sample: 0,
        offset_us: 0,
        clipped: 0,
        saturated: 0,
        settling: false,
    };

    /// A window whose first step this is; the step itself is not added yet.
    #[inline]
    pub(crate) fn starting_with(step: &Step, network: &Network<'_>) -> Self {
        Self {
            fc: *network.fc_bias,
            first_sample: step.sample,
            settling: step.settling,
            ..Self::EMPTY
        }
    }

    /// Adds what a time step lost to the window's counts.
    #[inline]
    pub(crate) fn count(&mut self, step: &Step) {
        self.clipped = self.clipped.saturating_add(step.clipped);
        self.saturated |= step.saturated;
        self.offset_us = step.offset_us;
    }

    /// Adds a time step to the linear shortcut.
    #[inline]
    pub(crate) fn add_electrodes(
        &mut self,
        shortcut: &[Pair; SHORTCUT_PAIRS],
        electrodes: &[Pair; ELECTRODE_PAIRS],
    ) {
        Network::shortcut(shortcut).accumulate(electrodes, &mut self.shortcut);
    }

    /// Adds a pooled plane to the fully connected layer, piece by piece.
    #[inline]
    pub(crate) fn add_pooled(
        &mut self,
        fc: [&[Pair; FC_PAIRS]; FC_PIECES],
        pooled: &[Pair; POOLED_PAIRS],
    ) {
        let pieces = pooled.chunks_exact(POOLED_PAIRS / FC_PIECES);
        for (fc, pooled) in fc.into_iter().zip(pieces) {
            Network::fc(fc).accumulate(pooled, &mut self.fc);
        }
    }

    /// The code of the complete window.
    #[inline]
    pub(crate) fn code(&self, window: u32, network: &Network<'_>) -> Code {
        let (values, clipped_values) = CodeValues::of(CODE_FORMAT, |j| {
            let step = requantise_sum(
                self.fc[j],
                network.fc_multipliers[j],
                self.shortcut[j],
                network.shortcut_multipliers[j],
            );
            step.saturating_add(i32::from(network.code_zero_point[j]))
        });
        Code {
            window,
            first_sample: self.first_sample,
            offset_us: self.offset_us,
            clipped: self.clipped,
            clipped_values,
            saturated: self.saturated,
            settling: self.settling,
            values,
        }
    }
}
