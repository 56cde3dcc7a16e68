//! The shape of the encoder, and what a set of weights for it holds.

use int8_nn::{InputConv, Linear, Pair, PlaneShape};

use crate::{
    CODE, COLUMNS, Conv2, ELECTRODES, FC_PIECES, HAS_CONVOLUTIONS, HAS_SHORTCUT, PADS_SPACE,
    PADS_TIME, POOL, ROWS, STEPS, conv2,
};

/// Rows and columns of padding on each side of a plane, of both convolutions.
pub const MARGIN: usize = PADS_SPACE as usize;
/// One time step of the scalp grid, with its margin.
pub const CELL_PLANE: PlaneShape = PlaneShape {
    rows: ROWS + 2 * MARGIN,
    columns: COLUMNS + 2 * MARGIN,
    channels: 1,
};
/// Rows and columns behind the second convolution.
const FEATURE_MAP: [usize; 2] = [
    CELL_PLANE.rows - 4 + 2 * MARGIN,
    CELL_PLANE.columns - 4 + 2 * MARGIN,
];
/// As many time steps as a pool takes, behind the second convolution and the pool.
pub const POOLED: PlaneShape = PlaneShape {
    rows: FEATURE_MAP[0] / POOL[1],
    columns: FEATURE_MAP[1] / POOL[2],
    channels: 32,
};
/// Pairs of numbers there.
pub const POOLED_PAIRS: usize = POOLED.len() / 2;
/// One time step behind the first convolution, with its margin, as far as the pool reaches: of the
/// paper's network, one column less than there is.
pub const HIDDEN: PlaneShape = PlaneShape {
    rows: POOLED.rows * POOL[1] + 2,
    columns: POOLED.columns * POOL[2] + 2,
    channels: 16,
};
/// Pairs of channels there.
pub const HIDDEN_PAIRS: usize = HIDDEN.channels / 2;
/// The same without its margin: what the first convolution computes.
pub const HIDDEN_INTERIOR: PlaneShape = PlaneShape {
    rows: smaller(HIDDEN.rows - MARGIN, CELL_PLANE.rows - 2),
    columns: smaller(HIDDEN.columns - MARGIN, CELL_PLANE.columns - 2),
    channels: HIDDEN.channels,
};
/// Pooled planes of a window that padded steps do not reach: two convolutions take four steps.
pub const INNER_STEPS: usize = (STEPS - 4) / POOL[0];
/// Pooled planes at either end of a window that padded steps do reach.
pub const EDGE_STEPS: usize = if PADS_TIME { 2 / POOL[0] } else { 0 };
/// Pooled planes of a window.
pub const POOLED_STEPS: usize = if HAS_CONVOLUTIONS {
    INNER_STEPS + 2 * EDGE_STEPS
} else {
    0
};
/// Steps of a window that have a matrix of the linear shortcut.
pub const SHORTCUT_STEPS: usize = if HAS_SHORTCUT { STEPS } else { 0 };
/// Pairs of electrodes of a time step, filled up with zeros to a multiple of eight.
pub const ELECTRODE_PAIRS: usize = ELECTRODES.div_ceil(2).next_multiple_of(8);

const fn smaller(a: usize, b: usize) -> usize {
    if a < b { a } else { b }
}

/// Output channels of the convolutions, none where there are none.
pub const CONV1_OUTPUTS: usize = if HAS_CONVOLUTIONS { HIDDEN.channels } else { 0 };
/// The same of the second.
pub const CONV2_OUTPUTS: usize = if HAS_CONVOLUTIONS { POOLED.channels } else { 0 };
/// Pairs in the weights of the first convolution, as its kernel reads them.
pub const CONV1_PAIRS: usize = InputConv::<{ CELL_PLANE.columns }>::weights_len(CONV1_OUTPUTS);
/// The same of the second.
pub const CONV2_PAIRS: usize = Conv2::weights_len(CONV2_OUTPUTS);
/// Pairs in a matrix of the fully connected layer.
pub const FC_PAIRS: usize = FC_INPUTS * CODE / 2;
/// Pairs in a matrix of the linear shortcut.
pub const SHORTCUT_PAIRS: usize = ELECTRODE_PAIRS * CODE / 2;
/// Pairs of inputs of a matrix of the fully connected layer.
const FC_INPUTS: usize = POOLED_PAIRS / FC_PIECES;

/// Weights of a convolution, as many as the shapes ask for.
#[derive(Clone, Copy, Debug)]
pub struct ConvWeights<'w, const WEIGHTS: usize, const OUTPUTS: usize> {
    /// As the kernel reads them.
    pub weights: &'w [Pair; WEIGHTS],
    /// One per output channel, accumulator steps.
    pub bias: &'w [i32; OUTPUTS],
    /// Requantisation factors, one per output channel, Q0.32; behind the pool negative for a channel
    /// whose weights are negated because its batch norm has a negative factor.
    pub multipliers: &'w [i32; OUTPUTS],
}

/// An int8 encoder: convolution, convolution, max-pool, fully connected, plus a linear shortcut; or
/// one of both alone.
#[derive(Clone, Copy, Debug)]
pub struct Network<'w> {
    /// Time steps from one window to the next, 8 or 16: a multiple of the pool's steps, so that the
    /// pool's phase is the same in every window.
    pub hop: usize,
    /// Scalp grid -> 16 channels.
    pub conv1: ConvWeights<'w, CONV1_PAIRS, CONV1_OUTPUTS>,
    /// 16 -> 32 channels, and pool.
    pub conv2: ConvWeights<'w, CONV2_PAIRS, CONV2_OUTPUTS>,
    /// What the second convolution's padding holds, channel by channel: the number that stands for 0
    /// behind the batch norm. Unused without padding.
    pub hidden_padding: [Pair; HIDDEN_PAIRS],
    /// What is added to every number that is not padding, so that none is negative. Unused without
    /// padding.
    pub hidden_offset: [Pair; HIDDEN_PAIRS],
    /// Fully connected layer, [`FC_PIECES`](crate::FC_PIECES) matrices for each pooled plane of a window.
    pub fc: [[&'w [Pair; FC_PAIRS]; FC_PIECES]; POOLED_STEPS],
    /// Its bias, accumulator steps.
    pub fc_bias: &'w [i32; CODE],
    /// Factors into the code, Q0.32.
    pub fc_multipliers: &'w [i32; CODE],
    /// Linear shortcut, one matrix for each time step of a window.
    pub shortcut: [&'w [Pair; SHORTCUT_PAIRS]; SHORTCUT_STEPS],
    /// Factors into the code, Q0.32.
    pub shortcut_multipliers: &'w [i32; CODE],
    /// The step of a float zero.
    pub code_zero_point: &'w [i8; CODE],
}

impl<'w> Network<'w> {
    /// The first convolution. Its shape is known when it is compiled, so that checks and strides
    /// vanish.
    #[inline]
    pub const fn conv1(&self) -> InputConv<'w, { CELL_PLANE.columns }> {
        InputConv {
            rows: CELL_PLANE.rows,
            output: HIDDEN_INTERIOR,
            weights: self.conv1.weights,
            bias: self.conv1.bias,
            multipliers: self.conv1.multipliers,
        }
    }

    /// The second convolution and its pool, likewise.
    #[inline]
    pub const fn conv2(&self) -> Conv2<'w> {
        conv2(self.conv2.weights)
    }

    /// A piece of the fully connected layer, from its weights.
    #[inline]
    pub const fn fc(weights: &[Pair; FC_PAIRS]) -> Linear<'_> {
        Linear {
            inputs: FC_INPUTS,
            outputs: CODE,
            weights,
        }
    }

    /// A step of the linear shortcut, from its weights.
    #[inline]
    pub const fn shortcut(weights: &[Pair; SHORTCUT_PAIRS]) -> Linear<'_> {
        Linear {
            inputs: ELECTRODE_PAIRS,
            outputs: CODE,
            weights,
        }
    }

    /// A sum over everything that a network holds: FNV-1a over words (Fowler, Noll and Vo; 32 bits),
    /// which a change of any single word changes. A board compares it with
    /// [`NETWORK_SUM`](crate::NETWORK_SUM) before it trusts what lies in its flash.
    pub const fn sum(&self) -> u32 {
        let mut sum = Sum::EMPTY;
        sum.pairs(self.conv1.weights);
        sum.words(self.conv1.bias);
        sum.words(self.conv1.multipliers);
        sum.pairs(self.conv2.weights);
        sum.words(self.conv2.bias);
        sum.words(self.conv2.multipliers);
        sum.pairs(&self.hidden_padding);
        sum.pairs(&self.hidden_offset);
        let matrices = self.fc.as_flattened();
        let mut index = 0;
        while index < matrices.len() {
            sum.pairs(matrices[index]);
            index += 1;
        }
        sum.words(self.fc_bias);
        sum.words(self.fc_multipliers);
        let mut index = 0;
        while index < self.shortcut.len() {
            sum.pairs(self.shortcut[index]);
            index += 1;
        }
        sum.words(self.shortcut_multipliers);
        let mut index = 0;
        while index < CODE {
            sum.word(self.code_zero_point[index].cast_unsigned() as u32);
            index += 1;
        }
        sum.0
    }

    /// True when windows and pools of a stream coincide and the kernels fit the shapes, so that none
    /// of them can refuse; asserted at compile time for the built-in network. That there are as many
    /// weights as the shapes ask for, their types say.
    pub const fn is_consistent(&self) -> bool {
        const FC: &[Pair; FC_PAIRS] = &[Pair::ZERO; FC_PAIRS];
        const SHORTCUT: &[Pair; SHORTCUT_PAIRS] = &[Pair::ZERO; SHORTCUT_PAIRS];
        let (fc, shortcut) = (Self::fc(FC), Self::shortcut(SHORTCUT));
        (self.hop == 8 || self.hop == STEPS)
            && self.hop.is_multiple_of(POOL[0])
            && shortcut.is_consistent(ELECTRODE_PAIRS, CODE)
            && fc.is_consistent(FC_INPUTS, CODE)
            && (!HAS_CONVOLUTIONS
                || self.conv1().is_consistent(CELL_PLANE, HIDDEN_INTERIOR)
                    && self.conv2().is_consistent(HIDDEN, POOLED))
    }
}

/// FNV-1a, word by word.
struct Sum(u32);

impl Sum {
    const EMPTY: Self = Self(0x811c_9dc5);

    const fn word(&mut self, word: u32) {
        self.0 = (self.0 ^ word).wrapping_mul(0x0100_0193);
    }

    const fn words(&mut self, words: &[i32]) {
        let mut index = 0;
        while index < words.len() {
            self.word(words[index].cast_unsigned());
            index += 1;
        }
    }

    const fn pairs(&mut self, pairs: &[Pair]) {
        let mut index = 0;
        while index < pairs.len() {
            self.word(pairs[index].0);
            index += 1;
        }
    }
}
