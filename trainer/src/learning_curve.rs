//! Errors of a training run over its epochs.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Errors before the first epoch and after each one, in units of `input.sd_uv` squared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearningCurve {
    /// Mean squared error of the initial parameters on the validation windows.
    pub initial_validation: f64,
    /// Errors of each epoch, from epoch 1.
    pub epochs: Vec<EpochLosses>,
}

/// Errors of one epoch, in units of `input.sd_uv` squared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpochLosses {
    /// Mean training loss over the batches of the epoch.
    pub loss: f64,
    /// Mean squared error on the validation windows after the epoch.
    pub validation: f64,
}

/// Course of a training run.
#[derive(Clone, Debug, PartialEq)]
pub struct Learning {
    /// Errors of all epochs, including those before a checkpoint.
    pub curve: LearningCurve,
    /// Epoch with the smallest validation error; 0 for the initial parameters.
    pub best_epoch: u32,
    /// Mean squared error of PCA on the validation windows, in units of `input.sd_uv` squared.
    pub pca_validation: f64,
}

impl LearningCurve {
    /// Returns the validation errors from epoch 0, that of the initial parameters.
    pub fn validations(&self) -> impl Iterator<Item = f64> {
        let epochs = self.epochs.iter().map(|epoch| epoch.validation);
        std::iter::once(self.initial_validation).chain(epochs)
    }
}

impl fmt::Display for LearningCurve {
    /// Writes the numbers with enough digits to parse to the same bits: the initial validation
    /// error, then loss and validation error of each epoch.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.initial_validation)?;
        for EpochLosses { loss, validation } in &self.epochs {
            write!(f, " {loss} {validation}")?;
        }
        Ok(())
    }
}

impl FromStr for LearningCurve {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
        let numbers = numbers.map_err(|_| ())?;
        let (&initial_validation, rest) = numbers.split_first().ok_or(())?;
        let (epochs, []) = rest.as_chunks() else {
            return Err(());
        };
        let losses = |&[loss, validation]: &[f64; 2]| EpochLosses { loss, validation };
        Ok(Self {
            initial_validation,
            epochs: epochs.iter().map(losses).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_the_same_after_its_text() {
        let losses = |loss, validation| EpochLosses { loss, validation };
        let curve = LearningCurve {
            initial_validation: 0.1 + 0.2,
            epochs: vec![losses(1.0 / 3.0, 1e-7), losses(2.0, f64::INFINITY)],
        };
        assert_eq!(curve.to_string().parse(), Ok(curve.clone()));
        let validations: Vec<f64> = curve.validations().collect();
        assert_eq!(validations, [0.1 + 0.2, 1e-7, f64::INFINITY]);
    }

    #[test]
    fn other_texts_are_refused() {
        for text in ["", "0.5 0.25", "0.5 x 1"] {
            assert_eq!(text.parse::<LearningCurve>(), Err(()), "{text}");
        }
    }
}
