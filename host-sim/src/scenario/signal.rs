//! The signal at the electrodes.

use link::Substitutes;
use offline::{OfflineError, Played, first_channels};
use pipeline::Sample;
use recordings::{Missing, RecordingError, VirtualAdc};
use thiserror::Error;

use super::file::SourceTable;
use crate::session::Source;
use crate::synthetic::{Generator, SyntheticError, SyntheticSpec};

/// Number of samples of the synthetic EEG: 20 s. It is played forwards and backwards in turn,
/// because generating it takes longer than everything else in a rehearsal.
const SYNTHETIC_SAMPLES: usize = 20 * model::ADC_RATE_HZ as usize;

/// Samples at the ADC's rate.
pub(super) enum Signal {
    Recording(Box<VirtualAdc>),
    /// Samples, and the number of samples played so far.
    Synthetic(Vec<Sample>, usize),
}

/// Why the signal cannot be opened, or ends too early.
#[derive(Debug, Error)]
pub enum SignalError {
    /// The recording cannot be opened.
    #[error("the recording of the scenario cannot be used")]
    Open(#[from] OfflineError),
    /// The recording cannot be read to its end.
    #[error("the recording broke off")]
    Read(#[from] RecordingError),
    /// The recording is shorter than the scenario.
    #[error("the recording ends before the scenario; lower duration_s, or write no recording")]
    TooShort,
    /// The generator of synthetic EEG refuses the model's electrodes.
    #[error(transparent)]
    Synthetic(#[from] SyntheticError),
}

impl Signal {
    /// Opens the signal. Also returns which electrodes the signal lacks.
    pub(super) fn open(table: &SourceTable) -> Result<(Self, Substitutes), SignalError> {
        if let Some(path) = &table.recording {
            let played = Played::open(path, Missing::Interpolate)?;
            return Ok((Self::Recording(Box::new(played.adc)), played.substitutes));
        }
        let mut spec = SyntheticSpec::new(table.seed, model::LABELS.split(' '));
        spec.rails = table.rails;
        let mut generator = Source::Synthetic(Box::new(Generator::new(&spec)?));
        let mut samples = Vec::with_capacity(SYNTHETIC_SAMPLES);
        while samples.len() < SYNTHETIC_SAMPLES {
            samples.extend(generator.next_sample()?);
        }
        Ok((Self::Synthetic(samples, 0), Substitutes::NONE))
    }

    pub(super) fn next_sample(&mut self) -> Result<Sample, SignalError> {
        match self {
            Self::Recording(adc) => {
                let counts = adc.next().transpose()?.ok_or(SignalError::TooShort)?;
                Ok(first_channels(counts))
            }
            Self::Synthetic(samples, played) => {
                let last = samples.len() - 1;
                let phase = *played % (2 * last);
                *played += 1;
                Ok(samples[phase.min(2 * last - phase)])
            }
        }
    }
}
