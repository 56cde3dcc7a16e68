//! EEG as input: synthetic, and recordings through the virtual ADC.

use std::env;
use std::path::{Path, PathBuf};

use host_sim::synthetic::{Generator, SyntheticSpec};
use model::CHANNELS;
use pipeline::{Acquisition, Mains, Plane, Sample};
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};

use super::failure::Failure;

/// ADC counts of all channels at one sample time.
pub(crate) type Counts = [i32; CHANNELS];

/// Returns an endless generator of EEG, the same on every call.
pub(crate) fn synthetic() -> Result<Generator, Failure> {
    let spec = SyntheticSpec::new(3, model::LABELS.split(' '));
    Generator::new(&spec).map_err(Failure::input)
}

/// Returns the path of a recording below the folder in `CORTICODE_DATA`, or the reason to skip it.
pub(crate) fn recording(file: &str) -> Result<PathBuf, String> {
    match env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty()) {
        Some(folder) => Ok(PathBuf::from(folder).join(file)),
        None => Err(format!(
            "real EEG as input: CORTICODE_DATA is not set; it names the folder that has {file}"
        )),
    }
}

/// Reads at most `samples` samples from the start of a recording, as the virtual ADC delivers them.
///
/// # Errors
/// The file cannot be read or lacks electrodes.
pub(crate) fn recorded(path: &Path, samples: usize) -> Result<Vec<Counts>, Failure> {
    let recording = Recording::open(path).map_err(Failure::input)?;
    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let map = MontageMap::new(&recording.labels(), &electrodes, Missing::Interpolate);
    let adc = AdcSpec::ads1299(model::ADC_RATE_HZ.into());
    let adc = VirtualAdc::new(recording, &map.map_err(Failure::input)?, adc);
    let samples: Result<Vec<Counts>, _> = adc.map_err(Failure::input)?.take(samples).collect();
    samples.map_err(Failure::input)
}

/// Returns the planes of at most `steps` time steps that the acquisition makes of these samples.
pub(crate) fn planes(
    mains: Mains,
    samples: impl IntoIterator<Item = Counts>,
    steps: usize,
) -> Vec<Plane> {
    let mut acquisition = Acquisition::new(mains);
    samples
        .into_iter()
        .filter_map(|counts| acquisition.push(&Sample { counts }))
        .map(|step| step.plane)
        .take(steps)
        .collect()
}
