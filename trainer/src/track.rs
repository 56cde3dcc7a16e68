//! A recording behind the device's own front end.

use crate::error::TrainerError;
use crate::resampler::Resampler;
use crate::selection::file_name;
use artifact::{Description, ELECTRODES};
use fixed_dsp::Cascade;
use model_gen::headroom::GUARD_BITS;
use pipeline::{FrontEnd, Sample};
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc, Warning};
use std::path::Path;

/// Sections of the card's filters: a notch, and five for a band-pass of order 5.
const SECTIONS: usize = 6;

/// All electrodes at one time step.
pub type Step = [f32; ELECTRODES];

/// What is left out at the start of every recording, s: the 0.5 Hz high-pass answers the step from
/// silence to the recording's offset. After 4 s its envelope exp(-2 pi 0.5 cos(72 deg) t) is 0.02.
/// The device's flag `settling` lasts until 1e-4, 9.5 s. The checked-in model was trained and measured
/// with this figure: a longer one belongs to the next training, or `trainer evaluate` would disagree
/// with `model.toml`.
pub const SETTLING_S: usize = 4;

/// Steps of the front end's output in a count.
const STEPS_PER_COUNT: f64 = (1_u32 << GUARD_BITS) as f64;

/// A recording as the encoder would see it: 128 Hz, filtered, in the montage's order.
#[derive(Clone, Debug)]
pub struct Track {
    /// The file's name.
    pub name: String,
    /// Time steps behind the filters' settling, uV.
    pub steps: Vec<Step>,
    /// Labels of the electrodes that the recording lacks and that were interpolated.
    pub interpolated: Vec<String>,
    /// Counts that the virtual ADC limited to its rails.
    pub saturated: u64,
    /// What is wrong with the file but did not keep it from being read.
    pub warnings: Vec<Warning>,
}

impl Track {
    /// Plays a recording through a virtual ADC and the filters that `description` names.
    ///
    /// # Errors
    /// When the recording cannot be read, does not fit the montage, or the filters cannot be
    /// realised.
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
        let uv_per_step = adc.lsb_uv() / STEPS_PER_COUNT;
        let mut virtual_adc = VirtualAdc::new(recording, &map, spec).map_err(unreadable)?;
        let mut steps: Vec<Step> = Vec::new();
        for counts in &mut virtual_adc {
            let counts = counts.map_err(unreadable)?;
            let filtered = filters.push(&Sample { counts });
            if let Some(electrodes) = filtered.and_then(|(now, _)| resampler.push(now)) {
                #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
                steps.push(electrodes.map(|v| (f64::from(v) * uv_per_step) as f32));
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
