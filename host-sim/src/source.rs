//! Sources of samples: a recording or synthetic EEG.

use pipeline::Sample;
use recordings::{RecordingError, VirtualAdc, virtual_adc};

use crate::synthetic::Generator;

const _: () = assert!(model::CHANNELS <= virtual_adc::CHANNELS);

/// A stream of samples at the ADC's rate.
pub enum Source {
    /// A recording, converted to samples by the virtual ADC; finite.
    Recording(Box<VirtualAdc>),
    /// Synthetic EEG; endless.
    Synthetic(Box<Generator>),
}

impl Source {
    /// Returns the next sample; `None` at the end of a recording.
    ///
    /// # Errors
    /// [`RecordingError`] if the rest of the recording cannot be read.
    pub fn next_sample(&mut self) -> Result<Option<Sample>, RecordingError> {
        match self {
            Self::Recording(adc) => adc
                .next()
                .transpose()
                .map(|counts| counts.map(first_channels)),
            Self::Synthetic(generator) => Ok(Some(first_channels(generator.next_sample()))),
        }
    }

    /// Returns the total number of samples; `None` for an endless source.
    pub fn samples(&self) -> Option<u64> {
        match self {
            Self::Recording(adc) => Some(adc.samples()),
            Self::Synthetic(_) => None,
        }
    }
}

/// Returns the sample of the model's ADC. The sources fill the channels of the longest chain; those
/// beyond the model's carry no electrode.
fn first_channels(counts: [i32; virtual_adc::CHANNELS]) -> Sample {
    Sample {
        counts: std::array::from_fn(|channel| counts[channel]),
    }
}
