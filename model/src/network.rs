//! The shape of the encoder, and what a set of weights for it holds.

use int8_nn::{InputConv, Linear, PlaneShape, Winograd};

use crate::{CODE, COLUMNS, ELECTRODES, ROWS, STEPS};

/// One time step of the scalp grid.
pub const CELL_PLANE: PlaneShape = PlaneShape {
    rows: ROWS,
    columns: COLUMNS,
    channels: 1,
};
/// One time step behind the first convolution, without the last column: an unpadded second
/// convolution and a 2x2 pool do not reach it.
pub const HIDDEN: PlaneShape = PlaneShape {
    rows: ROWS - 2,
    columns: COLUMNS - 3,
    channels: 16,
};
/// Pairs of channels there.
pub const HIDDEN_PAIRS: usize = HIDDEN.channels / 2;
/// Two time steps behind the second convolution and its pool.
pub const POOLED: PlaneShape = HIDDEN.convolved(32).pooled();
/// Pairs of numbers there.
pub const POOLED_PAIRS: usize = POOLED.len() / 2;
/// Pairs of electrodes of a time step, filled up with zeros to a multiple of eight.
pub const ELECTRODE_PAIRS: usize = ELECTRODES.div_ceil(2).next_multiple_of(8);
/// Pooled planes of a window: two unpadded convolutions take four steps, the pool halves the rest.
pub const POOLED_STEPS: usize = (STEPS - 4) / 2;

/// An int8 encoder: convolution, convolution, max-pool, fully connected, plus a linear shortcut.
#[derive(Clone, Copy, Debug)]
pub struct Network<'w> {
    /// Time steps from one window to the next, 8 or 16: even, so that the pool's phase is the same
    /// in every window.
    pub hop: usize,
    /// Scalp grid -> 16 channels.
    pub conv1: InputConv<'w, COLUMNS>,
    /// 16 -> 32 channels, and pool.
    pub conv2: Winograd<'w, HIDDEN_PAIRS, { HIDDEN.columns }>,
    /// Its bias, accumulator steps.
    pub conv2_bias: &'w [i32],
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
            let pooled = index >= POOLED_STEPS || self.fc[index].is_consistent(POOLED_PAIRS, CODE);
            if !pooled || !self.shortcut[index].is_consistent(ELECTRODE_PAIRS, CODE) {
                return false;
            }
            index += 1;
        }
        (self.hop == 8 || self.hop == STEPS)
            && self.conv1.is_consistent(CELL_PLANE, HIDDEN)
            && self.conv2.is_consistent(HIDDEN, POOLED)
            && self.conv2_bias.len() == POOLED.channels
            && self.conv2_multipliers.len() == POOLED.channels
    }
}
