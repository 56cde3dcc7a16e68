//! What the encoder is counted on: planes that no head makes, and EEG.

use std::path::{Path, PathBuf};

use bench::hop;
use bench::stress::Stress;
use host_sim::synthetic::{Generator, SyntheticSpec};
use model::CHANNELS;
use pipeline::{Acquisition, Mains, Plane, Sample};

use super::super::inputs::{self, unusable};
use crate::failure::Failure;

/// Real EEG below the folder that `CORTICODE_DATA` names: 125 s, mains at 60 Hz, held out of the
/// training.
const REAL: &str = "eegmmidb_S001/S001R11.edf";

/// The inputs one after the other, all of the same length.
#[derive(Debug)]
pub(crate) struct Inputs {
    /// Their names.
    pub(crate) names: Vec<&'static str>,
    /// Planes of each.
    pub(crate) planes: Vec<Vec<Plane>>,
    /// Windows of each.
    pub(crate) windows: usize,
    /// What could not be had.
    pub(crate) skipped: Vec<String>,
}

impl Inputs {
    /// Makes inputs with at least so many windows in all; the same on every run.
    ///
    /// # Errors
    /// The real recording is announced, and cannot be read or is too short.
    pub(crate) fn make(windows: usize) -> Result<Self, Failure> {
        let real = std::env::var_os("CORTICODE_DATA").filter(|path| !path.is_empty());
        let count = Stress::ALL.len() + 1 + usize::from(real.is_some());
        let windows = windows.div_ceil(count);
        let steps = hop::steps(windows);
        let mut inputs = Self {
            names: Vec::new(),
            planes: Vec::new(),
            windows,
            skipped: Vec::new(),
        };
        for stress in Stress::ALL {
            inputs.add(stress.name(), stress.planes().take(steps).collect());
        }
        let spec = SyntheticSpec::new(3, model::LABELS.split(' '));
        let generator = Generator::new(&spec).map_err(unusable)?;
        inputs.add("synthetic EEG", acquired(Mains::Hz50, generator, steps));
        if let Some(folder) = real {
            inputs.add(
                "real EEG",
                recorded(&PathBuf::from(folder).join(REAL), steps)?,
            );
        } else {
            let why = "real EEG as input: CORTICODE_DATA is not set; it names the folder that has";
            inputs.skipped.push(format!("{why} {REAL}"));
        }
        Ok(inputs)
    }

    fn add(&mut self, name: &'static str, planes: Vec<Plane>) {
        self.names.push(name);
        self.planes.push(planes);
    }

    /// As the image reads them: the length of each in steps, then their planes.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let steps = hop::steps(self.windows);
        let length = u32::try_from(steps).unwrap_or(u32::MAX).to_le_bytes();
        let cells = self.planes.iter().flatten().flatten();
        let cells = cells.map(|cell| cell.cast_unsigned());
        length.into_iter().chain(cells).collect()
    }
}

/// The planes that the acquisition makes of counts, so many at most.
fn acquired(
    mains: Mains,
    counts: impl IntoIterator<Item = [i32; CHANNELS]>,
    steps: usize,
) -> Vec<Plane> {
    let mut acquisition = Acquisition::new(mains);
    counts
        .into_iter()
        .filter_map(|counts| acquisition.process_sample(&Sample { counts }))
        .map(|step| step.plane)
        .take(steps)
        .collect()
}

/// The recording's planes, from its beginning.
fn recorded(path: &Path, steps: usize) -> Result<Vec<Plane>, Failure> {
    let planes = acquired(Mains::Hz60, inputs::recorded(path, usize::MAX)?, steps);
    if planes.len() == steps {
        Ok(planes)
    } else {
        Err(unusable(format!(
            "{} has {} steps, {steps} are needed; ask for fewer --windows",
            path.display(),
            planes.len()
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_windows_are_made_as_were_asked_for_and_eeg_is_no_silence() {
        let inputs = Inputs::make(100).expect("inputs");
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
