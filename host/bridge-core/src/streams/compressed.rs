//! ADC samples that the device has compressed.

use link::{BlockForm, CompressedRaw, Raw};
use lossless::{Block, DecodeError, Decoder, Kind};

/// Largest number of channels that a message can state.
const CHANNELS: usize = u8::MAX as usize;

/// Decodes compressed samples to those of a [`Raw`] message.
#[derive(Debug, Default)]
pub(crate) struct CompressedSamples {
    /// Decoder, once a message has arrived.
    decoder: Option<Box<Decoder<CHANNELS>>>,
    /// Index of the sample after the newest decoded one.
    next: u64,
    /// Number of samples that arrived and could not be decoded, because the blocks that they continue
    /// from were lost. They count as lost too.
    pub(crate) undecodable: u64,
}

impl CompressedSamples {
    /// Forgets what was decoded. Call this when the device counts samples from 0 again.
    pub(crate) fn forget(&mut self) {
        if let Some(decoder) = &mut self.decoder {
            decoder.forget();
        }
    }

    /// Returns the samples of a message; `None` if the samples that it continues from were lost.
    ///
    /// # Errors
    /// If the message is not what a sound device sends.
    pub(crate) fn decode<'d>(
        &'d mut self,
        message: &CompressedRaw,
    ) -> Result<Option<Raw<'d>>, Refusal> {
        let decoder = self.decoder.get_or_insert_with(|| Box::new(Decoder::NEW));
        if message.first_sample != self.next {
            decoder.forget();
        }
        let kind = match message.form {
            BlockForm::Verbatim => Kind::Verbatim,
            BlockForm::Key => Kind::Key,
            BlockForm::Continuing => Kind::Continuing,
            BlockForm::Newer(form) => {
                decoder.forget();
                return Err(Refusal::Form(form));
            }
        };
        let block = Block {
            kind,
            samples: message.samples.into(),
            bytes: message.bytes,
        };
        let samples = u64::from(message.samples);
        self.next = message.first_sample.wrapping_add(samples);
        match decoder.decode(message.channels.into(), &block) {
            Ok(counts) => Ok(Some(Raw {
                first_sample: message.first_sample,
                channels: message.channels,
                flags: message.flags,
                counts: counts.as_flattened(),
            })),
            // A sum that does not fit shows a loss that the indices do not.
            Err(DecodeError::NoKey | DecodeError::Sum) => {
                self.undecodable = self.undecodable.saturating_add(samples);
                Ok(None)
            }
            Err(error) => Err(Refusal::Block(error)),
        }
    }
}

/// Reason why a message was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Refusal {
    /// The form is newer than this bridge.
    #[error("compressed samples have the unknown form {0}")]
    Form(u8),
    #[error("compressed samples cannot be decoded: {0}")]
    Block(DecodeError),
}
