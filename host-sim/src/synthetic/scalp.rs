//! Sensitivity of the electrodes to sources under the scalp.

use recordings::Position;

use super::spec::SyntheticError;

/// Positions of the electrodes.
#[derive(Debug, Clone)]
pub(super) struct Scalp {
    positions: Vec<Position>,
}

impl Scalp {
    /// # Errors
    /// [`SyntheticError::UnknownElectrode`].
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

    /// Returns the weight of a source at each electrode, 0..=1: `1 / (1 + d^2 / reach^2)^2`, with d the
    /// straight distance between points of the unit sphere.
    ///
    /// The formula is a bell curve without an exponential. Rounding to 2^-20 removes the last bits
    /// of the positions, which differ with the platform's sines.
    pub(super) fn weights(&self, source: Position, reach: f64) -> Vec<f64> {
        let weight = |position: &Position| {
            let bell = 1.0 + position.chord_squared(source) / (reach * reach);
            (1.0 / (bell * bell) * 1_048_576.0).round() / 1_048_576.0
        };
        self.positions.iter().map(weight).collect()
    }
}
