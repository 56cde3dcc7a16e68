//! Where the virtual board's samples come from.

use pipeline::Sample;
use recordings::{RecordingError, VirtualAdc};

use crate::synthetic::Generator;

const _: () = assert!(model::CHANNELS == recordings::virtual_adc::CHANNELS);

/// A stream of samples at the ADC's rate.
pub enum Source {
    /// A recording through the virtual ADC; it ends.
    Recording(Box<VirtualAdc>),
    /// Synthetic EEG; it does not.
    Synthetic(Box<Generator>),
}

impl Source {
    /// The next sample; none at the end of a recording.
    ///
    /// # Errors
    /// When the recording cannot be read on.
    pub fn next_sample(&mut self) -> Result<Option<Sample>, RecordingError> {
        match self {
            Self::Recording(adc) => adc
                .next()
                .transpose()
                .map(|counts| counts.map(|counts| Sample { counts })),
            Self::Synthetic(generator) => Ok(Some(Sample {
                counts: generator.next_sample(),
            })),
        }
    }

    /// Samples that are to come in all; none for a source that does not end.
    pub fn samples(&self) -> Option<u64> {
        match self {
            Self::Recording(adc) => Some(adc.samples()),
            Self::Synthetic(_) => None,
        }
    }
}
