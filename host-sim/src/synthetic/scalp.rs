//! Positions of the electrodes, and the weights of sources under the scalp at each electrode.

use recordings::Position;

use super::spec::SyntheticError;

/// Positions of the electrodes on the unit sphere, in the order of the spec.
#[derive(Debug, Clone)]
pub(super) struct Scalp {
    positions: Vec<Position>,
}

impl Scalp {
    /// Looks up the positions of the electrodes with these labels.
    ///
    /// # Errors
    /// [`SyntheticError::UnknownElectrode`] for a label that is not in the 10-5 system.
    pub(super) fn new(labels: &[String]) -> Result<Self, SyntheticError> {
        let position = |label: &String| {
            Position::from_label(label).ok_or_else(|| SyntheticError::UnknownElectrode {
                label: label.clone(),
            })
        };
        Ok(Self {
            positions: labels.iter().map(position).collect::<Result<_, _>>()?,
        })
    }

    pub(super) fn electrodes(&self) -> usize {
        self.positions.len()
    }

    /// Returns the weight of a source at each electrode, 0..=1: `1 / (1 + d^2 / reach^2)^2`, where
    /// d is the straight distance between source and electrode on the unit sphere.
    ///
    /// The formula is a bell curve without an exponential. Weights are rounded to 2^-20, which
    /// hides differences in the last bits of the positions between platforms.
    pub(super) fn weights(&self, source: Position, reach: f64) -> Vec<f64> {
        let weight = |position: &Position| {
            let bell = 1.0 + position.chord_squared(source) / (reach * reach);
            (1.0 / (bell * bell) * 1_048_576.0).round() / 1_048_576.0
        };
        self.positions.iter().map(weight).collect()
    }
}
