//! Inputs of the benchmarks on emulated microcontrollers.

use std::env;
use std::path::{Path, PathBuf};

use host_sim::synthetic::{Generator, SyntheticSpec};
use model::CHANNELS;
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};

use super::failure::Failure;

/// ADC counts of all channels at one sample time.
pub(crate) type Counts = [i32; CHANNELS];

/// Named inputs, each as blocks or planes.
#[derive(Debug)]
pub(crate) struct Inputs<T> {
    pub(crate) names: Vec<&'static str>,
    pub(crate) data: Vec<Vec<T>>,
    /// Reasons for which inputs are left out, one per input.
    pub(crate) skipped: Vec<String>,
}

impl<T> Inputs<T> {
    pub(crate) fn new() -> Self {
        Self {
            names: Vec::new(),
            data: Vec::new(),
            skipped: Vec::new(),
        }
    }

    pub(crate) fn add(&mut self, name: &'static str, data: Vec<T>) {
        self.names.push(name);
        self.data.push(data);
    }
}

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
pub(crate) fn recorded(path: &Path, samples: usize) -> Result<Vec<Counts>, Failure> {
    let recording = Recording::open(path).map_err(Failure::input)?;
    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let map = MontageMap::new(&recording.labels(), &electrodes, Missing::Interpolate);
    let adc = AdcSpec::ads1299(model::ADC_RATE_HZ.into());
    let adc = VirtualAdc::new(recording, &map.map_err(Failure::input)?, adc);
    let samples: Result<Vec<Counts>, _> = adc.map_err(Failure::input)?.take(samples).collect();
    samples.map_err(Failure::input)
}
