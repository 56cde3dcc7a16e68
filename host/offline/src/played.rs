//! A recording as sampled by the model's ADC, and after the model's filters.

use std::path::{Path, PathBuf};

use link::Substitutes;
use pipeline::{ELECTRODES, Electrodes, FrontEnd, Mains, Sample};
use recordings::{
    AdcSpec, Missing, MontageMap, Onsets, Recording, VirtualAdc, montage_map::Origin, virtual_adc,
};

use crate::error::OfflineError;

const _: () = assert!(model::CHANNELS <= virtual_adc::CHANNELS);

/// A recording as the model's ADC measures it, with its montage, warnings and events.
pub struct Played {
    /// Virtual ADC, which yields the samples of the recording.
    pub adc: VirtualAdc,
    /// Which electrodes the recording lacks, and whether they are interpolated or 0.
    pub substitutes: Substitutes,
    /// Text for the user that states where the samples of each electrode come from.
    pub montage: String,
    /// Defects of the recording, one sentence each.
    pub warnings: Vec<String>,
    /// Starts of the events within the played signal.
    pub onsets: Onsets,
}

impl Played {
    /// Opens a recording at its first sample.
    ///
    /// # Errors
    /// [`OfflineError`] if the file is no recording, or does not fit the model's montage and ADC.
    pub fn open(path: &Path, missing: Missing) -> Result<Self, OfflineError> {
        let reading = |error| OfflineError::Recording(path.to_owned(), error);
        let mut recording = Recording::open(path).map_err(reading)?;
        let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
        let map = MontageMap::new(&recording.labels(), &electrodes, missing);
        let map = map.map_err(|error| OfflineError::Montage(path.to_owned(), error))?;
        let onsets = recording.onsets().map_err(reading)?;
        let spec = AdcSpec {
            rate_hz: model::ADC_RATE_HZ.into(),
            lsb_uv: f64::from(model::LSB_NV) / 1_000.0,
        };
        let adc = VirtualAdc::new(recording, &map, spec).map_err(reading)?;
        let of_map = map.warnings();
        let warnings = of_map.iter().map(ToString::to_string);
        let of_recording = adc.recording().warnings();
        let warnings = warnings.chain(of_recording.iter().map(ToString::to_string));
        Ok(Self {
            substitutes: Substitutes {
                interpolated: bits(&map, |origin| matches!(origin, Origin::Interpolated(_))),
                zero: bits(&map, |origin| matches!(origin, Origin::Zero)),
            },
            montage: map.to_string(),
            warnings: warnings.collect(),
            onsets,
            adc,
        })
    }
}

/// Returns the model's channels of a virtual ADC's sample. The virtual ADC has as many channels as
/// the longest chain of converters; channels beyond the model's carry no electrode.
pub fn first_channels(counts: [i32; virtual_adc::CHANNELS]) -> Sample {
    Sample { counts: std::array::from_fn(|channel| counts[channel]) }
}

/// Returns a bit set of the electrodes whose origin is `wanted`.
fn bits(map: &MontageMap, wanted: impl Fn(&Origin) -> bool) -> u64 {
    let electrodes = (0..u64::BITS).zip(map.origins());
    let electrodes = electrodes.filter(|(_, origin)| wanted(origin));
    electrodes.fold(0, |bits, (electrode, _)| bits | 1 << electrode)
}

/// Computes the filtered steps of a recording, before their conversion to int8.
pub(crate) struct Original {
    path: PathBuf,
    pub(crate) played: Played,
    front_end: FrontEnd<'static, Mains, { model::PHASES }, { model::TAPS }>,
}

impl Original {
    /// Opens a recording at its first sample, with the filters at rest. `missing` selects the
    /// treatment of electrodes that the recording lacks.
    ///
    /// # Errors
    /// The errors of [`Played::open`].
    pub(crate) fn open(path: &Path, mains: Mains, missing: Missing) -> Result<Self, OfflineError> {
        Ok(Self {
            path: path.to_owned(),
            played: Played::open(path, missing)?,
            front_end: FrontEnd::new(mains, &model::RESAMPLER),
        })
    }

    /// Returns the filtered values of the next step, microvolts; `None` at the recording's end.
    ///
    /// # Errors
    /// [`OfflineError::Recording`] if the rest of the recording cannot be read.
    pub(crate) fn next_step(&mut self) -> Result<Option<[f32; ELECTRODES]>, OfflineError> {
        while let Some(counts) = self.played.adc.next() {
            let counts =
                counts.map_err(|error| OfflineError::Recording(self.path.clone(), error))?;
            if let Some((electrodes, _)) = self.front_end.filter_sample(&first_channels(counts)) {
                return Ok(Some(microvolts(&electrodes)));
            }
        }
        Ok(None)
    }
}

/// Converts the filters' output, counts with [`model::GUARD_BITS`] fraction bits, to microvolts.
pub fn microvolts(electrodes: &Electrodes) -> [f32; ELECTRODES] {
    let levels_per_count = f32::from(1_u16 << model::GUARD_BITS);
    #[expect(
        clippy::cast_precision_loss,
        reason = "24 bits are far finer than the decoder's error"
    )]
    electrodes.map(|value| value as f32 / levels_per_count * model::LSB_NV / 1000.0)
}
