//! The windows that are not complete yet: their accumulators and slots.

use int8_nn::{Pair, requantise_sum};
use model::{
    CODE, CODE_FORMAT, ELECTRODE_PAIRS, FC_PAIRS, FC_PIECES, Network, OPEN_WINDOWS, POOLED_PAIRS,
    SHORTCUT_PAIRS,
};

use crate::code::{Code, CodeValues};
use crate::sample::Step;

/// Accumulators of one window that is not complete yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpenWindow {
    fc: [i32; CODE],
    shortcut: [i32; CODE],
    first_sample: u64,
    offset_us: u16,
    clipped: u16,
    saturated: u64,
    settling: bool,
}

impl OpenWindow {
    /// A slot without a window.
    pub(super) const EMPTY: Self = Self {
        fc: [0; CODE],
        shortcut: [0; CODE],
        first_sample: 0,
        offset_us: 0,
        clipped: 0,
        saturated: 0,
        settling: false,
    };

    /// Returns a window whose first step is `step`, with the bias in its accumulators. The caller
    /// then adds the step itself with [`Self::add_events`] and [`Self::add_electrodes`].
    #[inline]
    pub(super) fn start_with(step: &Step, network: &Network<'_>) -> Self {
        Self {
            fc: *network.fc_bias,
            first_sample: step.sample,
            settling: step.settling,
            ..Self::EMPTY
        }
    }

    /// Adds a step's clipped values and channels at the rail, and stores the step's time offset.
    #[inline]
    pub(super) fn add_events(&mut self, step: &Step) {
        self.clipped = self.clipped.saturating_add(step.clipped);
        self.saturated |= step.saturated;
        self.offset_us = step.offset_us;
    }

    /// Adds the product of a step's electrodes to the accumulators of the linear shortcut.
    #[inline]
    pub(super) fn add_electrodes(
        &mut self,
        shortcut: &[Pair; SHORTCUT_PAIRS],
        electrodes: &[Pair; ELECTRODE_PAIRS],
    ) {
        Network::shortcut(shortcut).accumulate(electrodes, &mut self.shortcut);
    }

    /// Adds a pooled plane's product, piece by piece, to the fully connected layer's accumulators.
    #[inline]
    pub(super) fn add_pooled(
        &mut self,
        fc: [&[Pair; FC_PAIRS]; FC_PIECES],
        pooled: &[Pair; POOLED_PAIRS],
    ) {
        let pieces = pooled.chunks_exact(POOLED_PAIRS / FC_PIECES);
        for (fc, pooled) in fc.into_iter().zip(pieces) {
            Network::fc(fc).accumulate(pooled, &mut self.fc);
        }
    }

    /// Returns the code of this window, which is complete; `window` is its index.
    #[inline]
    pub(super) fn code(&self, window: u32, network: &Network<'_>) -> Code {
        let (values, clipped_values) = CodeValues::from_levels(CODE_FORMAT, |j| {
            let level = requantise_sum(
                self.fc[j],
                network.fc_multipliers[j],
                self.shortcut[j],
                network.shortcut_multipliers[j],
            );
            level.saturating_add(i32::from(network.code_zero_point[j]))
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

/// Iterates over the open windows that contain a plane, newest first. Each item is a pair of the
/// window's slot and the plane's index within the window. Window `w` contains the planes
/// `w * hop .. w * hop + length`.
///
/// The hop is a power of two, so that shifts replace divisions: a Cortex-M has no instruction for a
/// 64-bit division.
pub(super) fn containing_windows(
    plane: u64,
    hop: usize,
    length: usize,
) -> impl Iterator<Item = (usize, usize)> {
    debug_assert!(hop.is_power_of_two());
    let newest = plane >> hop.trailing_zeros();
    #[expect(clippy::cast_possible_truncation, reason = "a remainder below the hop")]
    let phase = plane as usize & (hop - 1);
    (0..OPEN_WINDOWS).filter_map(move |age| {
        let window = newest.checked_sub(age as u64)?;
        let offset = phase + age * hop;
        (offset < length).then(|| (slot_of(window), offset))
    })
}

/// Returns the index of the slot that holds open window `window`.
#[expect(clippy::cast_possible_truncation, reason = "a remainder below the number of slots")]
pub(super) fn slot_of(window: u64) -> usize {
    (window % OPEN_WINDOWS as u64) as usize
}
