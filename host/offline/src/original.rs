//! The filtered EEG of a recording, with which its decoded signals are compared.

use std::path::{Path, PathBuf};

use pipeline::{ELECTRODES, Electrodes, FrontEnd, Mains};
use recordings::{Missing, RecordingError};

use crate::error::OfflineError;
use crate::played::{Played, first_channels};

/// Steps of a recording after the filters, before they become int8.
pub(crate) struct Original {
    path: PathBuf,
    pub(crate) played: Played,
    front_end: FrontEnd<'static, Mains, { model::PHASES }, { model::TAPS }>,
}

impl Original {
    /// Opens a recording, whose missing electrodes get the treatment `missing`, and puts the filters at rest before its first sample.
    ///
    /// # Errors
    /// Those of [`Played::open`].
    pub(crate) fn open(path: &Path, mains: Mains, missing: Missing) -> Result<Self, OfflineError> {
        Ok(Self {
            path: path.to_owned(),
            played: Played::open(path, missing)?,
            front_end: FrontEnd::new(mains, &model::RESAMPLER),
        })
    }

    /// Returns the electrodes at the next step, microvolts; `None` at the end of the recording.
    ///
    /// # Errors
    /// [`OfflineError::Recording`] if the rest cannot be read.
    pub(crate) fn next_step(&mut self) -> Result<Option<[f32; ELECTRODES]>, OfflineError> {
        while let Some(counts) = self.played.adc.next() {
            let counts = counts.map_err(|source: RecordingError| OfflineError::Recording {
                path: self.path.clone(),
                source,
            })?;
            if let Some((electrodes, _)) = self.front_end.filter_sample(&first_channels(counts)) {
                return Ok(Some(microvolts(&electrodes)));
            }
        }
        Ok(None)
    }
}

/// Converts the filters' output, counts with [`model::GUARD_BITS`] fraction bits, to microvolts.
fn microvolts(electrodes: &Electrodes) -> [f32; ELECTRODES] {
    let levels_per_count = f32::from(1_u16 << model::GUARD_BITS);
    #[expect(
        clippy::cast_precision_loss,
        reason = "24 bits are far finer than the decoder's error"
    )]
    electrodes.map(|value| value as f32 / levels_per_count * model::LSB_NV / 1000.0)
}
