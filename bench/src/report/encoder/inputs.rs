//! Inputs of the encoder: synthetic planes that no EEG contains, and EEG.

use std::path::Path;

use pipeline::{Mains, Plane};

use crate::hop;
use crate::report::eeg;
use crate::report::failure::Failure;
use crate::stress::Stress;

/// Real EEG below the folder in `CORTICODE_DATA`: 125 s, mains at 60 Hz, not used in training.
const REAL: &str = "eegmmidb_S001/S001R11.edf";

/// Planes of all inputs, which have the same length.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    pub(crate) names: Vec<&'static str>,
    /// Planes of each input.
    pub(crate) planes: Vec<Vec<Plane>>,
    /// Windows of each input.
    pub(crate) windows: usize,
    /// Inputs that are left out, with the reason.
    pub(crate) skipped: Vec<String>,
}

impl Inputs {
    /// Makes inputs with at least `windows` windows together, the same on every run.
    ///
    /// # Errors
    /// `CORTICODE_DATA` is set, and its recording cannot be read or is too short.
    pub(crate) fn new(windows: usize) -> Result<Self, Failure> {
        let real = eeg::recording(REAL);
        let count = Stress::ALL.len() + 1 + usize::from(real.is_ok());
        let windows = windows.div_ceil(count);
        let steps = hop::steps(windows);
        let mut inputs = Self {
            windows,
            ..Self::default()
        };
        for stress in Stress::ALL {
            inputs.add(stress.name(), stress.planes().take(steps).collect());
        }
        let synthetic = eeg::planes(Mains::Hz50, eeg::synthetic()?, steps);
        inputs.add("synthetic EEG", synthetic);
        match real {
            Ok(path) => inputs.add("real EEG", recorded(&path, steps)?),
            Err(reason) => inputs.skipped.push(reason),
        }
        Ok(inputs)
    }

    fn add(&mut self, name: &'static str, planes: Vec<Plane>) {
        self.names.push(name);
        self.planes.push(planes);
    }

    /// Returns the contents of the input file: the time steps of each input, then the planes of all.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let steps = hop::steps(self.windows);
        let length = u32::try_from(steps).unwrap_or(u32::MAX).to_le_bytes();
        let cells = self.planes.iter().flatten().flatten();
        let cells = cells.map(|cell| cell.cast_unsigned());
        length.into_iter().chain(cells).collect()
    }
}

/// Returns the planes of a recording's first time steps.
fn recorded(path: &Path, steps: usize) -> Result<Vec<Plane>, Failure> {
    let samples = eeg::recorded(path, usize::MAX)?;
    let planes = eeg::planes(Mains::Hz60, samples, steps);
    if planes.len() == steps {
        return Ok(planes);
    }
    let (path, length) = (path.display(), planes.len());
    Err(Failure::input(format!(
        "{path} has {length} time steps, {steps} are needed; ask for fewer --windows"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_requested_number_of_windows_is_made_and_eeg_is_not_silent() {
        let inputs = Inputs::new(100).expect("inputs");
        let all = inputs.names.len() * inputs.windows;
        assert!((100..100 + inputs.names.len()).contains(&all), "{all}");
        let steps = 16 + 8 * (inputs.windows - 1);
        assert!(inputs.planes.iter().all(|planes| planes.len() == steps));
        assert_eq!(inputs.bytes().len(), 4 + inputs.names.len() * steps * 90);
        let eeg = inputs.planes[4][steps / 2..].as_flattened();
        let loud = eeg.iter().filter(|cell| cell.unsigned_abs() > 1).count();
        assert!(loud > eeg.len() / 10, "{loud} of {}", eeg.len());
    }
}
