//! The table that predicts each electrode from the others, with which a device finds and replaces
//! bad electrodes.

use int8_nn::Linear;

use crate::checksum::Checksum;
use crate::constants::ELECTRODES;
use crate::shapes::{ELECTRODE_OUTPUTS, ELECTRODE_PAIRS};

/// The prediction of each electrode from all others, and the typical error of the prediction.
#[derive(Clone, Copy, Debug)]
pub struct Substitution<'w> {
    /// Matrix from the electrodes of a step, [`ELECTRODE_PAIRS`] pairs, to their predictions,
    /// [`ELECTRODE_OUTPUTS`] sums, Q7: prediction = sum / 128, in the unit of the inputs. No
    /// electrode has a weight in its own prediction, and the outputs beyond [`ELECTRODES`] are 0.
    ///
    /// The magnitudes of a row's weights sum to 2,047 at most, so that a sum over inputs of
    /// magnitude 4,096 stays below 2^23, as [`Linear::accumulate`] requires.
    pub prediction: Linear<'w>,
    /// Typical mean square of each electrode's innovation (the electrode minus its prediction),
    /// (1/16 uV)^2, 1..=2^26.
    pub innovation: &'w [i32; ELECTRODES],
}

impl Substitution<'_> {
    /// Returns true if the matrix has the shape of this montage, so that no product is left out.
    /// Asserted at compile time.
    pub const fn is_consistent(&self) -> bool {
        self.prediction.is_consistent(ELECTRODE_PAIRS, ELECTRODE_OUTPUTS)
    }

    /// Returns the checksum of matrix and innovations. A board compares it with
    /// [`SUBSTITUTION_CHECKSUM`](crate::SUBSTITUTION_CHECKSUM) to detect damaged flash.
    pub const fn checksum(&self) -> u32 {
        let mut sum = Checksum::EMPTY;
        sum.add_pairs(self.prediction.weights);
        sum.add_words(self.innovation);
        sum.value()
    }
}
