//! The Adam optimiser.
//!
//! The state is plain vectors, so a resumed training run equals an uninterrupted one bit for bit.

use crate::parameters::{Parameters, is_statistic, rate_factor};
use std::collections::BTreeMap;

/// Factor by which the mean gradient decays in an update, beta1.
const MEAN_DECAY: f32 = 0.9;
/// Factor by which the mean squared gradient decays in an update, beta2.
const SQUARE_DECAY: f32 = 0.999;
/// Number added to the denominator, which keeps the update finite when gradients vanish.
const EPSILON: f32 = 1e-8;

/// Gradients, keyed by tensor name, in row-major order.
pub type Gradients = BTreeMap<&'static str, Vec<f32>>;

/// Adam (Kingma and Ba, arXiv 1412.6980, algorithm 1) with its usual constants.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    pub(crate) updates: u64,
    /// Decaying means of the gradient and of its square, keyed by tensor name.
    pub(crate) moments: BTreeMap<&'static str, Moments>,
}

/// Exponentially decaying means of one tensor's gradient and squared gradient.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    pub(crate) mean: Vec<f32>,
    pub(crate) square: Vec<f32>,
}

impl Adam {
    /// Creates an optimiser for all tensors of `parameters` except the running statistics.
    pub fn new(parameters: &Parameters) -> Self {
        let moments = parameters
            .iter()
            .filter(|(name, _)| !is_statistic(name))
            .map(|(name, values)| {
                let rest = vec![0.0; values.len()];
                (
                    name,
                    Moments {
                        mean: rest.clone(),
                        square: rest,
                    },
                )
            })
            .collect();
        Self {
            updates: 0,
            moments,
        }
    }

    /// Returns the number of updates so far.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Updates the parameters against the gradients, with learning rate `rate`.
    ///
    /// # Panics
    /// If a tensor has no gradient.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a rate and its corrections are f32"
    )]
    pub fn update(&mut self, parameters: &mut Parameters, gradients: &Gradients, rate: f64) {
        self.updates += 1;
        let exponent = i32::try_from(self.updates).unwrap_or(i32::MAX);
        let correction = |decay: f32| 1.0 - f64::from(decay).powi(exponent);
        let rate = (rate / correction(MEAN_DECAY)) as f32;
        let square_factor = (1.0 / correction(SQUARE_DECAY)) as f32;
        for (name, moments) in &mut self.moments {
            let rate = rate * rate_factor(name);
            let values = parameters.values_mut(name).iter_mut().zip(&gradients[name]);
            let state = moments.mean.iter_mut().zip(&mut moments.square);
            for ((value, gradient), (mean, square)) in values.zip(state) {
                *mean = MEAN_DECAY * *mean + (1.0 - MEAN_DECAY) * gradient;
                *square = SQUARE_DECAY * *square + (1.0 - SQUARE_DECAY) * gradient * gradient;
                *value -= rate * *mean / ((*square * square_factor).sqrt() + EPSILON);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn the_first_update_is_the_rate_against_the_sign_of_the_gradient() {
        let start = Parameters::pca(testing::geometry(), &testing::directions());
        let mut parameters = start.clone();
        let mut adam = Adam::new(&parameters);
        let gradients = start
            .iter()
            .map(|(name, values)| {
                (
                    name,
                    (0..values.len()).map(|i| [2.0, -0.1, 0.0][i % 3]).collect(),
                )
            })
            .collect();
        // The shortcut has a hundredth of the learning rate, so each update is +-1, or 0 without a gradient.
        adam.update(&mut parameters, &gradients, 100.0);
        for ((_, before), (_, after)) in start.iter().zip(parameters.iter()) {
            for (index, (before, after)) in before.iter().zip(after).enumerate() {
                let expected = [-1.0, 1.0, 0.0][index % 3];
                assert!((after - before - expected).abs() < 1e-5);
            }
        }
        assert_eq!(adam.updates(), 1);
    }
}
