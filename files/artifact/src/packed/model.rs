//! The integers that encoder and decoder share, and the reference computation with them.

use super::description::PackedDescription;
use super::integer_matrix::IntegerMatrix;
use super::smoother::Smoother;
use packed::{Costs, FREQUENCY_BITS, LEVELS, MAGNITUDES, Starts};

/// Fraction bits that the state loses before the prediction, so that sums of products fit 24 bits.
const STATE_BITS: u32 = 3;

/// A trained packed model. Encoder and decoder share every integer of it; only the smoother is the
/// decoder's own.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedModel {
    /// Dimensions and units, and the figures of the training.
    pub description: PackedDescription,
    /// From the values of a block, in the order step, electrode, to its coefficients.
    pub analysis: IntegerMatrix,
    /// From the coefficients of the previous state to the prediction of the next block's.
    pub prediction: IntegerMatrix,
    /// Level of each coefficient's mean magnitude at rate 4, 0..64, in a predicted block.
    pub predicted_levels: Vec<u8>,
    /// The same in a block without prediction.
    pub reset_levels: Vec<u8>,
    /// First frequency of each magnitude.
    pub starts: Box<Starts>,
    /// What the reconstruction adds one block later.
    pub smoother: Smoother,
}

impl PackedModel {
    /// Number of coefficients of a block.
    pub fn coefficients(&self) -> usize {
        self.description.coefficients
    }

    /// Returns the coefficients of a block of input values, in the order step, electrode.
    ///
    /// # Panics
    /// If the number of values is not that of a block.
    pub fn analyse(&self, values: &[i16]) -> Vec<i16> {
        self.analysis.multiply(values)
    }

    /// Returns the prediction of the next block's coefficients from the state after a block.
    ///
    /// # Panics
    /// If the number of coefficients differs.
    pub fn predict(&self, state: &[i16]) -> Vec<i16> {
        let rounded: Vec<i16> = state.iter().map(|&s| rounded_state(s)).collect();
        self.prediction.multiply(&rounded)
    }

    /// Returns the bits of each magnitude, 1/16 bit, from their frequencies; the sign included.
    pub fn costs(&self) -> Box<Costs> {
        let mut costs = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
        let rows = self.starts.iter().flatten();
        for (costs, starts) in costs.iter_mut().flatten().zip(rows) {
            let ends = starts[1..].iter().copied().chain([1 << FREQUENCY_BITS]);
            for (magnitude, (start, end)) in starts.iter().zip(ends).enumerate() {
                let count = f64::from(end.saturating_sub(*start).max(1));
                let sign = f64::from(u8::from(magnitude > 0));
                let bits = f64::from(FREQUENCY_BITS) - count.log2() + sign;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "0 to 255"
                )]
                let sixteenths = (bits * 16.0).round().min(255.0) as u8;
                costs[magnitude] = sixteenths;
            }
        }
        costs
    }
}

/// Returns a coefficient of the state as the prediction reads it: rounded to multiples of 8, in eighths;
/// |x| <= 4096.
pub fn rounded_state(coefficient: i16) -> i16 {
    let half = 1 << (STATE_BITS - 1);
    #[expect(clippy::cast_possible_truncation, reason = "an eighth of 16 bits")]
    let rounded = ((i32::from(coefficient) + half) >> STATE_BITS) as i16;
    rounded
}
