//! The Adam optimiser.
//!
//! A checkpoint holds the whole state of the optimiser, so a resumed training run equals an
//! uninterrupted run bit for bit.

use crate::parameters::{Parameters, TENSORS, Weights};

/// Adam's beta1: the factor by which the mean gradient decays in an update.
const MEAN_DECAY: f32 = 0.9;
/// Adam's beta2: the factor by which the mean squared gradient decays in an update.
const SQUARE_DECAY: f32 = 0.999;
/// Number added to the denominator of an update, which keeps it finite when gradients vanish.
const EPSILON: f32 = 1e-8;

/// Adam (Kingma and Ba, arXiv 1412.6980, algorithm 1) with its usual constants.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Number of updates so far.
    pub(crate) updates: u64,
    /// Decaying means of the gradients of all trained tensors.
    pub(crate) mean: Weights,
    /// Decaying means of the squared gradients of all trained tensors.
    pub(crate) square: Weights,
}

impl Adam {
    /// Creates an optimiser for all trained tensors of `parameters`: all except the running
    /// statistics of batch norms.
    pub fn new(parameters: &Parameters) -> Self {
        let mut rest = Weights::default();
        for tensor in TENSORS.iter().filter(|tensor| tensor.is_trained()) {
            *tensor.of_mut(&mut rest) = vec![0.0; tensor.of(&parameters.weights).len()];
        }
        Self { updates: 0, mean: rest.clone(), square: rest }
    }

    /// Moves the parameters against their gradients, with learning rate `rate`.
    ///
    /// # Panics
    /// If a tensor has no gradient.
    #[expect(clippy::cast_possible_truncation, reason = "a rate and its corrections are f32")]
    pub fn update(&mut self, parameters: &mut Parameters, gradients: &Weights, rate: f64) {
        self.updates += 1;
        let exponent = i32::try_from(self.updates).unwrap_or(i32::MAX);
        let correction = |decay: f32| 1.0 - f64::from(decay).powi(exponent);
        let rate = (rate / correction(MEAN_DECAY)) as f32;
        let square_factor = (1.0 / correction(SQUARE_DECAY)) as f32;
        for tensor in TENSORS.iter().filter(|tensor| tensor.is_trained()) {
            let rate = rate * tensor.rate_factor();
            let values = tensor.of_mut(&mut parameters.weights);
            let gradients = tensor.of(gradients);
            assert_eq!(values.len(), gradients.len(), "the gradient of {}", tensor.name);
            let mean = tensor.of_mut(&mut self.mean).iter_mut();
            let state = mean.zip(tensor.of_mut(&mut self.square));
            for ((value, gradient), (mean, square)) in values.iter_mut().zip(gradients).zip(state) {
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
        let start = testing::pca();
        let mut parameters = start.clone();
        let mut adam = Adam::new(&parameters);
        let mut gradients = start.weights.clone();
        for tensor in TENSORS {
            let values = tensor.of_mut(&mut gradients).iter_mut().enumerate();
            values.for_each(|(index, value)| *value = [2.0, -0.1, 0.0][index % 3]);
        }
        // In mode `pca`, all tensors belong to the shortcut, whose learning rate is a hundredth of
        // the given rate, here 1. So each update is +-1, or 0 where the gradient is 0.
        adam.update(&mut parameters, &gradients, 100.0);
        for tensor in TENSORS {
            let before = tensor.of(&start.weights).iter();
            for (index, (before, after)) in before.zip(tensor.of(&parameters.weights)).enumerate() {
                let expected = [-1.0, 1.0, 0.0][index % 3];
                assert!((after - before - expected).abs() < 1e-5);
            }
        }
        assert_eq!(adam.updates, 1);
    }
}
