//! Consecutive unfiltered samples for one `CompressedRaw` message.

use link::{BlockForm, COUNT_BYTES, CompressedRaw, RAW_SAMPLES};
use lossless::{Block, Count, Encoder, EncoderState, Kind};
use model::{ADC_RATE_HZ, CHANNELS};

use crate::raw_chunk::RawChunk;

/// Time between two blocks that need no past, in parts of a second. A lost frame costs no more than
/// this time.
const KEYS_PER_SECOND: usize = 4;

#[expect(clippy::cast_possible_truncation, reason = "at most 2^16 / 32")]
const ENCODER: Encoder = Encoder {
    key_blocks: (ADC_RATE_HZ as usize / (KEYS_PER_SECOND * RAW_SAMPLES)) as u16,
};

const _: () = assert!(RAW_SAMPLES == lossless::MAX_SAMPLES && ENCODER.key_blocks > 0);

/// Up to [`RAW_SAMPLES`] consecutive samples, compressed.
#[derive(Clone, Debug)]
pub struct CompressedChunk {
    /// The chunk's index, flags and number of samples.
    message: CompressedRaw<'static>,
    /// Bytes of the block in `room`.
    length: usize,
    room: [[Count; CHANNELS]; RAW_SAMPLES],
}

impl CompressedChunk {
    /// Builds the `CompressedRaw` message, which borrows the chunk's bytes.
    pub(crate) fn message(&self) -> CompressedRaw<'_> {
        let bytes = self.room.as_flattened().as_flattened();
        CompressedRaw {
            bytes: bytes.get(..self.length).unwrap_or(bytes),
            ..self.message
        }
    }
}

/// Compresses the chunks of a run.
#[derive(Clone, Debug)]
pub(crate) struct Compressor {
    state: EncoderState<CHANNELS>,
    /// Index of the sample after the newest chunk.
    next: u64,
}

impl Compressor {
    pub(crate) const NEW: Self = Self {
        state: EncoderState::NEW,
        next: 0,
    };

    /// Starts a run, whose first chunk needs no past.
    pub(crate) const fn restart(&mut self) {
        self.state.require_key();
    }

    /// Compresses a chunk, as one that needs no past if samples before it are missing.
    pub(crate) fn compress(&mut self, chunk: &RawChunk) -> CompressedChunk {
        let raw = chunk.message();
        if raw.first_sample != self.next {
            self.state.require_key();
        }
        let samples = chunk.samples();
        self.next = raw.first_sample + samples.len() as u64;
        let mut room = [[[0; COUNT_BYTES]; CHANNELS]; RAW_SAMPLES];
        let Block { kind, bytes, .. } = ENCODER.encode(&mut self.state, samples, &mut room);
        let length = bytes.len();
        CompressedChunk {
            message: CompressedRaw {
                first_sample: raw.first_sample,
                channels: raw.channels,
                flags: raw.flags,
                form: match kind {
                    Kind::Verbatim => BlockForm::Verbatim,
                    Kind::Key => BlockForm::Key,
                    Kind::Continuing => BlockForm::Continuing,
                },
                #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
                samples: samples.len() as u8,
                bytes: &[],
            },
            length,
            room,
        }
    }
}
