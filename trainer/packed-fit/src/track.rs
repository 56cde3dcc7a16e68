//! A recording, filtered by the device's front end.

use crate::error::FitError;
use artifact::Description;
use model_gen::front_end::{Filters, Resampler};
use model_gen::headroom::GUARD_BITS;
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};
use std::fmt;
use std::path::Path;

/// Number of units of the front end's output, Q27.5, in one ADC count.
const UNITS_PER_COUNT: f64 = (1_u32 << GUARD_BITS) as f64;

/// A recording in the form that the encoder receives: filtered, at 128 Hz, electrodes in the order
/// of the montage.
#[derive(Clone, Debug)]
pub struct Track {
    /// File name of the recording.
    pub name: String,
    /// Number of electrodes of the montage.
    pub electrodes: usize,
    /// Filtered time steps, microvolts, in the order step, electrode (the last fastest); the steps
    /// in which the filters settle are omitted.
    pub values: Vec<f32>,
    /// Labels of electrodes that are missing in the recording and were interpolated.
    pub interpolated: Vec<String>,
    /// Indices of electrodes that were found to be bad, and interpolated.
    pub bad: Vec<usize>,
    /// Number of distinct signals of the recording that contribute to the electrodes, alone or
    /// mixed.
    pub signals: usize,
}

/// Returns the number of time steps at the start of a recording in which the filters still respond
/// to the recording's offset. During this time a device sets its flag `settling`.
///
/// # Errors
/// If the filters cannot be realised.
pub fn settling_steps(description: &Description, mains_hz: u32) -> Result<usize, FitError> {
    let samples = model_gen::settling_samples(description, mains_hz)?;
    let rate_hz = description.adc.rate_hz as usize;
    Ok((samples * description.window.rate_hz as usize).div_ceil(rate_hz))
}

impl Track {
    /// Creates the track of a recording that has all electrodes. `values` are its filtered time
    /// steps, microvolts, in the order step, electrode.
    pub fn new(name: &str, electrodes: usize, values: Vec<f32>) -> Self {
        Self {
            name: name.to_owned(),
            electrodes,
            values,
            interpolated: Vec::new(),
            bad: Vec::new(),
            signals: electrodes,
        }
    }

    /// Reads a recording and passes it through a virtual ADC and the filters of `description`. Also
    /// returns the warnings about the recording.
    ///
    /// # Errors
    /// If the recording cannot be read or does not fit the montage, or the filters cannot be
    /// realised.
    pub fn read(
        path: &Path,
        description: &Description,
        mains_hz: u32,
    ) -> Result<(Self, Vec<String>), FitError> {
        let name = path.file_name().unwrap_or_default();
        let name = name.to_string_lossy().into_owned();
        let unreadable = |source| FitError::Recording(name.clone(), source);
        let recording = Recording::open(path).map_err(unreadable)?;
        let electrodes = &description.montage.electrodes;
        let map = MontageMap::new(&recording.labels(), electrodes, Missing::Interpolate)
            .map_err(|source| FitError::Montage(name.clone(), source))?;
        let adc = &description.adc;
        let spec = AdcSpec { rate_hz: adc.rate_hz, lsb_uv: adc.lsb_uv() };
        let mut filters = Filters::new(description, mains_hz)
            .map_err(|source| FitError::Filter(mains_hz, source))?;
        let mut resampler = Resampler::new(description).map_err(FitError::Resampler)?;
        let uv_per_unit = adc.lsb_uv() / UNITS_PER_COUNT;
        let mut virtual_adc = VirtualAdc::new(recording, &map, spec).map_err(unreadable)?;
        let mut values: Vec<f32> = Vec::new();
        let electrodes = electrodes.len();
        for counts in &mut virtual_adc {
            let counts = counts.map_err(unreadable)?;
            let filtered = filters.filter_sample(&counts[..electrodes]);
            if let Some(step) = resampler.resample(filtered) {
                #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
                values.extend(step.iter().map(|v| (f64::from(*v) * uv_per_unit) as f32));
            }
        }
        let settling = settling_steps(description, mains_hz)? * electrodes;
        values.drain(..settling.min(values.len()));
        let interpolated = map.interpolated().into_iter().map(str::to_owned);
        let track = Self {
            name,
            electrodes,
            values,
            interpolated: interpolated.collect(),
            bad: Vec::new(),
            signals: map.used().len(),
        };
        let of_map = map.warnings();
        let of_map = of_map.iter().map(ToString::to_string);
        let of_file = virtual_adc.recording().warnings().iter();
        let of_file = of_file.map(ToString::to_string);
        let of_adc = virtual_adc.counters().warnings();
        Ok((track, of_map.chain(of_file).chain(of_adc).collect()))
    }

    /// Returns the part of the recording at the given time steps.
    ///
    /// # Panics
    /// If the part is not within the recording.
    #[must_use]
    pub fn part(&self, steps: std::ops::Range<usize>) -> Self {
        let values = steps.start * self.electrodes..steps.end * self.electrodes;
        Self {
            name: self.name.clone(),
            electrodes: self.electrodes,
            values: self.values[values].to_vec(),
            interpolated: self.interpolated.clone(),
            bad: self.bad.clone(),
            signals: self.signals,
        }
    }

    /// Returns the number of time steps.
    pub fn steps(&self) -> usize {
        self.values.len() / self.electrodes
    }
}

impl fmt::Display for Track {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, steps, lacking) = (&self.name, self.steps(), self.interpolated.len());
        write!(f, "{name}: {steps} time steps, {lacking} electrodes interpolated")
    }
}
