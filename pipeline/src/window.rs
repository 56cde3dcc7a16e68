//! The windows that are open at the same time.

use int8_nn::{requantise_sum, saturate_i8};
use model::{
    CODE, CODE_ZERO_POINT, FC, FC_BIAS, FC_MULTIPLIERS, HOP, SHORTCUT, SHORTCUT_MULTIPLIERS, STEPS,
};

/// Windows that a time step can belong to.
pub(crate) const OPEN: usize = STEPS / HOP;

/// Sums of one window that is not complete yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenWindow {
    fc: [i32; CODE],
    shortcut: [i32; CODE],
}

impl OpenWindow {
    /// A window to which nothing has been added.
    pub(crate) const EMPTY: Self = Self {
        fc: FC_BIAS,
        shortcut: [0; CODE],
    };

    /// Adds the window's `step`-th time step to the linear shortcut.
    #[inline]
    pub(crate) fn add_step(&mut self, step: usize, electrodes: &[i8]) {
        SHORTCUT[step].accumulate(electrodes, &mut self.shortcut);
    }

    /// Adds the window's `index`-th pooled plane to the fully connected layer.
    #[inline]
    pub(crate) fn add_pooled(&mut self, index: usize, pooled: &[u8]) {
        FC[index].accumulate(pooled, &mut self.fc);
    }

    /// The code of the complete window.
    #[inline]
    pub(crate) fn code(&self) -> [i8; CODE] {
        core::array::from_fn(|j| {
            let q = requantise_sum(
                self.fc[j],
                FC_MULTIPLIERS[j],
                self.shortcut[j],
                SHORTCUT_MULTIPLIERS[j],
            );
            saturate_i8(q.saturating_add(i32::from(CODE_ZERO_POINT[j])))
        })
    }
}
