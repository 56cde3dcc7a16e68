//! The constants that the encoder of the packed code needs: matrices, levels and frequencies.

use ::packed::Tables;
use int8_nn::Linear;

use crate::checksum::Checksum;
use crate::constants::{HOP, PACKED_COEFFICIENTS, PACKED_INPUT_PAIRS};

/// Weights, factors and tables of a packed model that the encoder needs, all as integers.
#[derive(Clone, Copy, Debug)]
pub struct Packed<'w> {
    /// Parts of the analysis matrix, one for each step of a block; each is applied to the groups of
    /// 16 inputs that its step completes.
    pub analysis: [Slice<'w>; HOP],
    /// For each coefficient, the factor that turns its sum of analysis products into the
    /// coefficient, Q0.32.
    pub analysis_factors: &'w [i32; PACKED_COEFFICIENTS],
    /// Matrix that predicts the next block's coefficients from the state, which holds the
    /// coefficients that a decoder has after the current block; the prediction reads the state
    /// rounded.
    pub prediction: Linear<'w>,
    /// For each coefficient, the factor that turns its sum of prediction products into the
    /// predicted coefficient, Q0.32.
    pub prediction_factors: &'w [i32; PACKED_COEFFICIENTS],
    /// Level (index in `tables`) of each coefficient's mean magnitude at quantiser rate 4, in a
    /// predicted block.
    pub predicted_levels: &'w [u8; PACKED_COEFFICIENTS],
    /// Level (index in `tables`) of each coefficient's mean magnitude at quantiser rate 4, in a
    /// block without prediction.
    pub reset_levels: &'w [u8; PACKED_COEFFICIENTS],
    /// Frequencies of the magnitudes for the range coder, and costs for the quantiser's trellis.
    pub tables: Tables<'w>,
    /// Factor from a filtered sample (counts, Q27.5) to an input value, Q0.32.
    pub input_multiplier: i32,
    /// Largest magnitude of an input value; larger ones are clipped.
    pub input_limit: i32,
    /// Energy of the inputs that the coefficients may fail to represent before a block counts as a
    /// misfit, in squares of input values; the encoder adds an allowance for rounding errors.
    /// Negative in a model with weighted errors, whose last coefficients are probes that measure
    /// this energy; its magnitude is then the limit.
    pub misfit_energy: i64,
    /// Quantiser rate until the host sets another, 0 (finest) to 15.
    pub rate: u8,
}

/// Part of the analysis matrix that the encoder applies after one step of a block. It covers the
/// groups of 16 inputs that this step completes; the part of the last step also covers the
/// remaining inputs.
#[derive(Clone, Copy, Debug)]
pub struct Slice<'w> {
    /// Index of the first pair of inputs in this slice, counted from the start of the block.
    pub first: usize,
    /// Matrix from the inputs of this slice to all coefficients.
    pub matrix: Linear<'w>,
}

impl Packed<'_> {
    /// Returns true if slices and prediction fit the block, so that no product is left out.
    /// Asserted at compile time.
    pub const fn is_consistent(&self) -> bool {
        let mut first = 0;
        let mut step = 0;
        while step < HOP {
            let Slice { first: at, matrix } = &self.analysis[step];
            // With few electrodes, some steps complete no group of inputs; the matrices of such
            // steps are empty.
            let is_empty = matrix.inputs == 0 && matrix.weights.is_empty();
            let fits = matrix.is_consistent(matrix.inputs, PACKED_COEFFICIENTS);
            if *at != first || !(fits || is_empty) {
                return false;
            }
            first += matrix.inputs;
            step += 1;
        }
        first == PACKED_INPUT_PAIRS
            && self.prediction.is_consistent(PACKED_COEFFICIENTS / 2, PACKED_COEFFICIENTS)
            && self.tables.is_consistent()
            && self.rate < 16
    }

    /// Returns the checksum of matrices, factors, levels and tables. A board compares it with
    /// [`PACKED_CHECKSUM`](crate::PACKED_CHECKSUM) to detect damaged flash.
    pub const fn checksum(&self) -> u32 {
        let mut sum = Checksum::EMPTY;
        let mut step = 0;
        while step < HOP {
            sum.add_pairs(self.analysis[step].matrix.weights);
            step += 1;
        }
        sum.add_words(self.analysis_factors);
        sum.add_pairs(self.prediction.weights);
        sum.add_words(self.prediction_factors);
        sum.add_bytes(self.predicted_levels);
        sum.add_bytes(self.reset_levels);
        sum.add_starts(self.tables.starts);
        sum.add_bytes(self.tables.costs.as_flattened().as_flattened());
        sum.value()
    }
}
