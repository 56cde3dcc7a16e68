//! A recording, filtered by the device's front end.

use crate::error::TrainerError;
use crate::filters::Filters;
use crate::resampler::Resampler;
use crate::selection::file_name;
use artifact::Description;
use model_gen::headroom::GUARD_BITS;
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc, Warning};
use std::path::Path;

/// Seconds omitted at the start of every recording, in which the 0.5 Hz high-pass responds to the offset
/// of the recording.
///
/// After 4 s the envelope of the response, exp(-2 pi 0.5 cos(72 deg) t), is 0.02. The device keeps its
/// flag `settling` set until the envelope is 1e-4, for 9.5 s. The checked-in model was trained and
/// evaluated with 4 s; with another value `trainer evaluate` would disagree with the model's `model.toml`.
pub const SETTLING_S: usize = 4;

/// Number of units of the front end's output in one ADC count.
const UNITS_PER_COUNT: f64 = (1_u32 << GUARD_BITS) as f64;

/// A recording as the encoder receives it: filtered, at 128 Hz, in the order of the montage.
#[derive(Clone, Debug)]
pub struct Track {
    /// File name of the recording.
    pub name: String,
    /// Number of electrodes.
    pub electrodes: usize,
    /// Filtered time steps, microvolts, in the order step, electrode (the last fastest); the first
    /// [`SETTLING_S`] seconds are omitted.
    pub values: Vec<f32>,
    /// Labels of electrodes that are missing in the recording and were interpolated.
    pub interpolated: Vec<String>,
    /// Number of counts that the virtual ADC limited to its rails.
    pub saturated: u64,
    /// Defects of the file that did not prevent reading it.
    pub warnings: Vec<Warning>,
}

impl Track {
    /// Reads a recording and passes it through a virtual ADC and the filters of `description`.
    ///
    /// # Errors
    /// If the recording cannot be read or does not fit the montage, or the filters cannot be realised.
    pub fn read(
        path: &Path,
        description: &Description,
        mains_hz: u32,
    ) -> Result<Self, TrainerError> {
        let name = file_name(path);
        let unreadable = |source| TrainerError::Recording {
            name: name.clone(),
            source,
        };
        let recording = Recording::open(path).map_err(unreadable)?;
        let electrodes = &description.montage.electrodes;
        let map = MontageMap::new(&recording.labels(), electrodes, Missing::Interpolate).map_err(
            |source| TrainerError::Montage {
                name: name.clone(),
                source,
            },
        )?;
        let adc = &description.adc;
        let spec = AdcSpec {
            rate_hz: adc.rate_hz,
            lsb_uv: adc.lsb_uv(),
        };
        let mut filters = Filters::new(description, mains_hz)?;
        let mut resampler = Resampler::new(description)?;
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
        let settling = SETTLING_S * description.window.rate_hz as usize * electrodes;
        values.drain(..settling.min(values.len()));
        let interpolated = map.interpolated().into_iter().map(str::to_owned).collect();
        let saturated = virtual_adc.counters().saturated;
        let warnings = virtual_adc.recording().warnings().to_vec();
        Ok(Self {
            name,
            electrodes,
            values,
            interpolated,
            saturated,
            warnings,
        })
    }

    /// Returns a part of the recording, in time steps.
    ///
    /// # Panics
    /// If the part is not within the recording.
    pub fn part(&self, steps: std::ops::Range<usize>) -> Self {
        let values = steps.start * self.electrodes..steps.end * self.electrodes;
        Self {
            values: self.values[values].to_vec(),
            ..self.without_values()
        }
    }

    fn without_values(&self) -> Self {
        Self {
            name: self.name.clone(),
            electrodes: self.electrodes,
            values: Vec::new(),
            interpolated: self.interpolated.clone(),
            saturated: self.saturated,
            warnings: self.warnings.clone(),
        }
    }

    /// Returns the number of time steps.
    pub fn steps(&self) -> usize {
        self.values.len() / self.electrodes
    }
}
