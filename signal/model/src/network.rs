//! The weights of the network, and their checksum.

use int8_nn::{InputConv, Linear, Pair};

use crate::{
    checksum::Checksum,
    constants::{CODE, FC_PIECES, HAS_CONVOLUTIONS, POOL, STEPS, conv_kernel},
    shapes::{
        CELL_PLANE, CONV1_OUTPUTS, CONV1_PAIRS, CONV2_OUTPUTS, CONV2_PAIRS, Conv2, ELECTRODE_PAIRS,
        FC_INPUTS, FC_PAIRS, HAS_NETWORK, HIDDEN, HIDDEN_INTERIOR, HIDDEN_PAIRS, OPEN_WINDOWS,
        POOLED, POOLED_STEPS, SHORTCUT_PAIRS, SHORTCUT_STEPS,
    },
};

/// Weights, biases and factors of a convolution.
#[derive(Clone, Copy, Debug)]
pub struct ConvWeights<'w, const WEIGHTS: usize, const OUTPUTS: usize> {
    /// Weights in the order that the convolution's kernel reads.
    pub weights: &'w [Pair; WEIGHTS],
    /// Bias of each output channel, in units of the accumulator.
    pub bias: &'w [i32; OUTPUTS],
    /// Requantisation factor of each output channel, Q0.32. In the second convolution, a channel
    /// whose batch norm has a negative gain has negated weights and a negative factor, because the
    /// max-pool precedes the batch norm.
    pub multipliers: &'w [i32; OUTPUTS],
}

/// An int8 encoder: convolutions with max-pool and fully connected layer, a linear shortcut, or
/// both.
#[derive(Clone, Copy, Debug)]
pub struct Network<'w> {
    /// Time steps from the start of one window to the start of the next: a power of two, and a
    /// multiple of the pool's steps, so that overlapping windows share pooled planes.
    pub hop: usize,
    /// First convolution, whose input is the scalp grid.
    pub conv1: ConvWeights<'w, CONV1_PAIRS, CONV1_OUTPUTS>,
    /// Second convolution, followed by the pool.
    pub conv2: ConvWeights<'w, CONV2_PAIRS, CONV2_OUTPUTS>,
    /// Padding of each input channel of the second convolution: the number that the first batch
    /// norm turns into 0, plus `hidden_offset`. Unused without padding.
    pub hidden_padding: [Pair; HIDDEN_PAIRS],
    /// Offset of each input channel of the second convolution, which makes the padding
    /// non-negative. The encoder adds the offset to the inputs inside the margin; `hidden_padding`
    /// already contains it. Unused without padding.
    pub hidden_offset: [Pair; HIDDEN_PAIRS],
    /// Packed weights of the fully connected layer, [`FC_PIECES`](crate::FC_PIECES) matrices for
    /// each pooled plane of a window.
    pub fc: [[&'w [Pair; FC_PAIRS]; FC_PIECES]; POOLED_STEPS],
    /// Bias of the fully connected layer, in units of its accumulator.
    pub fc_bias: &'w [i32; CODE],
    /// Requantisation factors of the fully connected layer, from accumulator to code level, Q0.32.
    pub fc_multipliers: &'w [i32; CODE],
    /// Packed weights of the linear shortcut, one matrix for each time step of a window.
    pub shortcut: [&'w [Pair; SHORTCUT_PAIRS]; SHORTCUT_STEPS],
    /// Requantisation factors of the linear shortcut, from accumulator to code level, Q0.32.
    pub shortcut_multipliers: &'w [i32; CODE],
    /// Level that stands for 0.0 in each value of the code.
    pub code_zero_point: &'w [i8; CODE],
}

impl<'w> Network<'w> {
    /// Returns the first convolution. Its shape is constant, so that the compiler can remove bounds
    /// checks and the computation of strides.
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

    /// Returns the second convolution with its pool. Its shape is constant, so that the compiler
    /// can remove bounds checks and the computation of strides.
    #[inline]
    pub const fn conv2(&self) -> Conv2<'w> {
        conv_kernel(POOLED, self.conv2.weights)
    }

    /// Returns a matrix of the fully connected layer with these packed weights.
    #[inline]
    pub const fn fc(weights: &[Pair; FC_PAIRS]) -> Linear<'_> {
        Linear { inputs: FC_INPUTS, outputs: CODE, weights }
    }

    /// Returns a matrix of the linear shortcut with these packed weights.
    #[inline]
    pub const fn shortcut(weights: &[Pair; SHORTCUT_PAIRS]) -> Linear<'_> {
        Linear { inputs: ELECTRODE_PAIRS, outputs: CODE, weights }
    }

    /// Returns the checksum of all weights, biases, factors and zero points: 32-bit FNV-1a (Fowler,
    /// Noll and Vo) over words. A change of any single word changes the checksum. A board compares
    /// the checksum with [`NETWORK_CHECKSUM`](crate::NETWORK_CHECKSUM) to detect damaged flash.
    pub const fn checksum(&self) -> u32 {
        let mut sum = Checksum::EMPTY;
        sum.add_pairs(self.conv1.weights);
        sum.add_words(self.conv1.bias);
        sum.add_words(self.conv1.multipliers);
        sum.add_pairs(self.conv2.weights);
        sum.add_words(self.conv2.bias);
        sum.add_words(self.conv2.multipliers);
        sum.add_pairs(&self.hidden_padding);
        sum.add_pairs(&self.hidden_offset);
        let matrices = self.fc.as_flattened();
        let mut index = 0;
        while index < matrices.len() {
            sum.add_pairs(matrices[index]);
            index += 1;
        }
        sum.add_words(self.fc_bias);
        sum.add_words(self.fc_multipliers);
        let mut index = 0;
        while index < self.shortcut.len() {
            sum.add_pairs(self.shortcut[index]);
            index += 1;
        }
        sum.add_words(self.shortcut_multipliers);
        let mut index = 0;
        while index < CODE {
            sum.add_word(self.code_zero_point[index].cast_unsigned() as u32);
            index += 1;
        }
        sum.value()
    }

    /// Returns true if the hop suits the window and the pool, and the kernels of the existing
    /// layers fit the shapes, so that no kernel can panic. Asserted at compile time for the
    /// built-in network. The numbers of weights need no check, because the types of the fields fix
    /// them.
    pub const fn is_consistent(&self) -> bool {
        const FC: &[Pair; FC_PAIRS] = &[Pair::ZERO; FC_PAIRS];
        const SHORTCUT: &[Pair; SHORTCUT_PAIRS] = &[Pair::ZERO; SHORTCUT_PAIRS];
        let (fc, shortcut) = (Self::fc(FC), Self::shortcut(SHORTCUT));
        self.hop.is_power_of_two()
            && self.hop <= STEPS
            && STEPS / self.hop <= OPEN_WINDOWS
            && self.hop.is_multiple_of(POOL[0])
            && (!HAS_NETWORK
                || shortcut.is_consistent(ELECTRODE_PAIRS, CODE)
                    && fc.is_consistent(FC_INPUTS, CODE))
            && (!HAS_CONVOLUTIONS
                || self.conv1().is_consistent(CELL_PLANE, HIDDEN_INTERIOR)
                    && self.conv2().is_consistent(HIDDEN, POOLED))
    }
}
