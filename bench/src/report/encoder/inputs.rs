//! Inputs of the encoder: synthetic planes that no EEG contains, and EEG.

use pipeline::{Acquisition, Mains, Plane, Sample};

use crate::hop;
use crate::report::failure::Failure;
use crate::report::inputs::{self, Counts, Inputs};
use crate::stress::Stress;

/// Real EEG below the folder in `CORTICODE_DATA`: 125 s, mains at 60 Hz, not used in training.
const REAL: &str = "eegmmidb_S001/S001R11.edf";

/// Makes inputs of equal length with at least `windows` windows together, the same on every run.
///
/// # Errors
/// `CORTICODE_DATA` is set, and its recording cannot be read or is too short.
pub(crate) fn inputs(windows: usize) -> Result<Inputs<Plane>, Failure> {
    let real = inputs::recording(REAL);
    let count = Stress::ALL.len() + 1 + usize::from(real.is_ok());
    let steps = hop::steps(windows.div_ceil(count));
    let mut inputs = Inputs::new();
    for stress in Stress::ALL {
        inputs.add(stress.name(), stress.planes().take(steps).collect());
    }
    let synthetic = planes(Mains::Hz50, inputs::synthetic()?, steps);
    inputs.add("synthetic EEG", synthetic);
    match real {
        Ok(path) => {
            let planes = planes(Mains::Hz60, inputs::recorded(&path, usize::MAX)?, steps);
            let (path, length) = (path.display(), planes.len());
            if length < steps {
                return Err(Failure::input(format!(
                    "{path} has {length} time steps, {steps} are needed; ask for fewer --windows"
                )));
            }
            inputs.add("real EEG", planes);
        }
        Err(reason) => inputs.skipped.push(reason),
    }
    Ok(inputs)
}

/// Returns the planes of at most `steps` time steps, computed by the acquisition from these
/// samples.
fn planes(mains: Mains, samples: impl IntoIterator<Item = Counts>, steps: usize) -> Vec<Plane> {
    let mut acquisition = Acquisition::new(mains);
    samples
        .into_iter()
        .filter_map(|counts| acquisition.process_sample(&Sample { counts }))
        .map(|step| step.plane)
        .take(steps)
        .collect()
}

/// Returns the contents of the input file: the time steps of each input, then the planes of all.
pub(crate) fn file(inputs: &Inputs<Plane>) -> Vec<u8> {
    let steps = inputs.data.first().map_or(0, Vec::len);
    let steps = u32::try_from(steps).unwrap_or(u32::MAX).to_le_bytes();
    let cells = inputs.data.as_slice().iter().flatten().flatten();
    let cells = cells.map(|cell| cell.cast_unsigned());
    steps.into_iter().chain(cells).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_requested_number_of_windows_is_made_and_eeg_is_not_silent() {
        let inputs = inputs(100).expect("inputs");
        let steps = inputs.data[0].len();
        // A window every 8 time steps, the first after 16.
        let all = inputs.names.len() * ((steps - 16) / 8 + 1);
        assert!((100..100 + inputs.names.len()).contains(&all), "{all}");
        assert!(inputs.data.iter().all(|planes| planes.len() == steps));
        assert_eq!(file(&inputs).len(), 4 + inputs.names.len() * steps * 90);
        let eeg = inputs.data[4][steps / 2..].as_flattened();
        let loud = eeg.iter().filter(|cell| cell.unsigned_abs() > 1).count();
        assert!(loud > eeg.len() / 10, "{loud} of {}", eeg.len());
    }
}
