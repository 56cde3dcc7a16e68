//! The shape of the encoder, and what a set of weights for it holds.

use int8_nn::{Conv3d, Linear, PlaneShape};

use crate::{CODE, COLUMNS, ELECTRODES, ROWS, STEPS};

/// One time step of the scalp grid.
pub const CELL_PLANE: PlaneShape = PlaneShape {
    rows: ROWS,
    columns: COLUMNS,
    channels: 1,
};
/// One time step behind the first convolution.
pub const HIDDEN: PlaneShape = CELL_PLANE.convolved(16);
/// One time step of the second convolution's accumulators.
pub const SUMS: PlaneShape = HIDDEN.convolved(32);
/// Pooled planes of a window: two unpadded convolutions take four steps, the pool halves the rest.
pub const POOLED_STEPS: usize = (STEPS - 4) / 2;

/// An int8 encoder: convolution, convolution, max-pool, fully connected, plus a linear shortcut.
#[derive(Clone, Copy, Debug)]
pub struct Network<'w> {
    /// Time steps from one window to the next, 8 or 16: even, so that the pool's phase is the same
    /// in every window.
    pub hop: usize,
    /// Scalp grid -> 16 channels.
    pub conv1: Conv3d<'w>,
    /// Requantisation factors behind it, Q0.32.
    pub conv1_multipliers: &'w [i32],
    /// 16 -> 32 channels.
    pub conv2: Conv3d<'w>,
    /// Requantisation factors behind pool and convolution, Q0.32; negative for a channel whose
    /// weights are negated because its batch norm has a negative factor.
    pub conv2_multipliers: &'w [i32],
    /// Fully connected layer, one matrix for each pooled plane of a window.
    pub fc: [Linear<'w>; POOLED_STEPS],
    /// Its bias, accumulator steps.
    pub fc_bias: &'w [i32; CODE],
    /// Factors into the code, Q0.32.
    pub fc_multipliers: &'w [i32; CODE],
    /// Linear shortcut, one matrix for each time step of a window.
    pub shortcut: [Linear<'w>; STEPS],
    /// Factors into the code, Q0.32.
    pub shortcut_multipliers: &'w [i32; CODE],
    /// The int8 code of a float zero.
    pub code_zero_point: &'w [i8; CODE],
}

impl Network<'_> {
    /// True when every array has the length that the shapes ask for, so that no kernel can meet a
    /// slice that is too short; asserted at compile time for the built-in network.
    pub const fn is_consistent(&self) -> bool {
        let mut index = 0;
        while index < STEPS {
            let pooled =
                index >= POOLED_STEPS || self.fc[index].is_consistent(SUMS.pooled().len(), CODE);
            if !pooled || !self.shortcut[index].is_consistent(ELECTRODES, CODE) {
                return false;
            }
            index += 1;
        }
        (self.hop == 8 || self.hop == STEPS)
            && self.conv1.is_consistent(CELL_PLANE, HIDDEN)
            && self.conv1_multipliers.len() == HIDDEN.channels
            && self.conv2.is_consistent(HIDDEN, SUMS)
            && self.conv2_multipliers.len() == SUMS.channels
    }
}
