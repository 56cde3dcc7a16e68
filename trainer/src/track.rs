//! A recording, filtered by the device's front end.

use crate::error::TrainerError;
use crate::resampler::Resampler;
use crate::selection::file_name;
use artifact::{Description, ELECTRODES};
use fixed_dsp::Cascade;
use model_gen::headroom::GUARD_BITS;
use pipeline::{FrontEnd, Sample};
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc, Warning};
use std::path::Path;

/// Number of sections that the trainer supports: one notch, and five for a band-pass of order 5.
const SECTIONS: usize = 6;

/// All electrodes at one time step.
pub type Step = [f32; ELECTRODES];

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
    /// Filtered time steps, microvolts; the first [`SETTLING_S`] seconds are omitted.
    pub steps: Vec<Step>,
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
        let every = fixed_dsp::Resampler::every(1);
        let mut filters = FrontEnd::new(cascade(description, mains_hz)?, &every);
        let mut resampler = Resampler::new(description)?;
        let uv_per_unit = adc.lsb_uv() / UNITS_PER_COUNT;
        let mut virtual_adc = VirtualAdc::new(recording, &map, spec).map_err(unreadable)?;
        let mut steps: Vec<Step> = Vec::new();
        for counts in &mut virtual_adc {
            let counts = counts.map_err(unreadable)?;
            let filtered = filters.filter_sample(&Sample { counts });
            if let Some(electrodes) = filtered.and_then(|(now, _)| resampler.resample(now)) {
                #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
                steps.push(electrodes.map(|v| (f64::from(v) * uv_per_unit) as f32));
            }
        }
        let settling = SETTLING_S * description.window.rate_hz as usize;
        steps.drain(..settling.min(steps.len()));
        let interpolated = map.interpolated().into_iter().map(str::to_owned).collect();
        let saturated = virtual_adc.counters().saturated;
        let warnings = virtual_adc.recording().warnings().to_vec();
        Ok(Self {
            name,
            steps,
            interpolated,
            saturated,
            warnings,
        })
    }
}

/// Returns the filters for a mains frequency, or an error if they do not have [`SECTIONS`] sections.
fn cascade(description: &Description, mains_hz: u32) -> Result<Cascade<SECTIONS>, TrainerError> {
    let rate_hz = description.adc.rate_hz;
    let sections = model_gen::filter_cascade(&description.filters, rate_hz, mains_hz)
        .map_err(|source| TrainerError::Filter { mains_hz, source })?;
    let found = sections.len();
    let sections = sections
        .try_into()
        .map_err(|_| TrainerError::Sections { found })?;
    Ok(Cascade { sections })
}
