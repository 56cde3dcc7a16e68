//! Electrodes on the head, and the potentials that dipoles cause at them.

use recordings::Position;

use super::{
    dipole::Dipole,
    head::{CONDUCTIVITIES, Head},
    spec::SyntheticError,
};

/// Positions next to the ear lobes. Their mean is the reference, as in EEGMMIDB, whose amplifier
/// had both ear lobes linked.
const REFERENCE: [&str; 2] = ["T9", "T10"];

/// Positions of the spec's electrodes on the unit sphere, in the order of the spec, and the model
/// of the head.
#[derive(Debug, Clone)]
pub(super) struct Scalp {
    head: Head,
    electrodes: Vec<Position>,
}

impl Scalp {
    /// Looks up the positions of the electrodes with these labels.
    ///
    /// # Errors
    /// [`SyntheticError::UnknownElectrode`] for a label that is not in the 10-5 system.
    pub(super) fn new(labels: &[String]) -> Result<Self, SyntheticError> {
        let position = |label: &String| {
            let unknown = || SyntheticError::UnknownElectrode(label.clone());
            Position::from_label(label).ok_or_else(unknown)
        };
        Ok(Self {
            head: Head::new(CONDUCTIVITIES),
            electrodes: labels.iter().map(position).collect::<Result<_, _>>()?,
        })
    }

    /// Returns the potentials of a dipole at the electrodes, times `scale`.
    ///
    /// Rounds the potentials to 2^-20, which hides differences between platforms in the last bits
    /// of the positions.
    pub(super) fn potentials(&self, dipole: &Dipole, scale: f64) -> Vec<f64> {
        let potentials = self.against_reference(dipole, &self.electrodes);
        let rounded = |potential: f64| (potential * scale * 1_048_576.0).round() / 1_048_576.0;
        potentials.into_iter().map(rounded).collect()
    }

    pub(super) fn electrodes(&self) -> usize {
        self.electrodes.len()
    }

    /// Returns the potential of a dipole at the electrode `label`, which the spec need not contain.
    pub(super) fn potential_at(&self, dipole: &Dipole, label: &str) -> f64 {
        let place = Position::from_label(label);
        let potentials = self.against_reference(dipole, place.as_slice());
        potentials.into_iter().sum()
    }

    /// Returns the total power that independent dipoles of RMS 1 cause at each electrode in
    /// `labels`, a list separated by blanks. The spec's electrodes have no influence on these
    /// powers.
    pub(super) fn powers_at(&self, dipoles: &[Dipole], labels: &str) -> Vec<f64> {
        let places = labels.split(' ').filter_map(Position::from_label);
        let mut powers: Vec<(Position, f64)> = places.map(|place| (place, 0.0)).collect();
        for dipole in dipoles {
            let places: Vec<Position> = powers.iter().map(|(place, _)| *place).collect();
            let potentials = self.against_reference(dipole, &places);
            for ((_, power), potential) in powers.iter_mut().zip(potentials) {
                *power += potential * potential;
            }
        }
        powers.into_iter().map(|(_, power)| power).collect()
    }

    fn against_reference(&self, dipole: &Dipole, places: &[Position]) -> Vec<f64> {
        let ears = REFERENCE.iter().filter_map(|ear| Position::from_label(ear));
        let reference: f64 = ears.map(|ear| self.head.potential(dipole, ear) / 2.0).sum();
        let potential = |place: &Position| self.head.potential(dipole, *place) - reference;
        places.iter().map(potential).collect()
    }
}
