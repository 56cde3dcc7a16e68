//! How strongly places under the scalp are seen by electrodes.

use recordings::Position;

use super::SyntheticError;

/// The electrodes' places.
#[derive(Debug, Clone)]
pub(super) struct Scalp {
    places: Vec<Position>,
}

impl Scalp {
    /// # Errors
    /// [`SyntheticError::UnknownElectrode`].
    pub(super) fn new(labels: &[String]) -> Result<Self, SyntheticError> {
        let place = |label: &String| {
            Position::from_label(label).ok_or_else(|| SyntheticError::UnknownElectrode {
                label: label.clone(),
            })
        };
        Ok(Self {
            places: labels.iter().map(place).collect::<Result<_, _>>()?,
        })
    }

    pub(super) fn electrodes(&self) -> usize {
        self.places.len()
    }

    /// What each electrode sees of a source, 0..=1: `1 / (1 + d^2 / reach^2)^2`, d = straight
    /// distance on the unit sphere. A bell without an exponential, rounded to 2^-20 so that the
    /// last bit of the platform's sines (in the positions) is gone.
    pub(super) fn weights(&self, source: Position, reach: f64) -> Vec<f64> {
        let weight = |place: &Position| {
            let bell = 1.0 + place.chord_squared(source) / (reach * reach);
            (1.0 / (bell * bell) * 1_048_576.0).round() / 1_048_576.0
        };
        self.places.iter().map(weight).collect()
    }
}
