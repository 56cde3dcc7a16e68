//! Consecutive samples or steps, collected for one message.

use link::{
    BlockForm, COUNT_BYTES, CompressedRaw, FILTERED_STEPS, Filtered, Flags, RAW_SAMPLES, Raw,
    VALUE_BYTES,
};
use lossless::{Block, Count, Encoder, EncoderState, Kind};
use model::{ADC_RATE_HZ, CHANNELS, ELECTRODES};
use pipeline::Step;

use crate::acquired_sample::{AcquiredSample, Marks};

/// Fraction bits of an electrode's filtered value (format Q27.5).
const FRACTION_BITS: u8 = 5;

/// Number of key blocks, which can be decoded without earlier blocks, per second. After a lost
/// frame the host also loses the samples up to the next key block, at most 1/4 s.
const KEYS_PER_SECOND: usize = 4;

#[expect(clippy::cast_possible_truncation, reason = "at most 2^16 / 32")]
const ENCODER: Encoder =
    Encoder { key_blocks: (ADC_RATE_HZ as usize / (KEYS_PER_SECOND * RAW_SAMPLES)) as u16 };

const _: () = assert!(RAW_SAMPLES == lossless::MAX_SAMPLES && ENCODER.key_blocks > 0);

/// Up to `MAX` consecutive items of `BYTES` bytes each, in their wire format.
#[derive(Clone, Copy, Debug)]
pub struct Chunk<const BYTES: usize, const MAX: usize> {
    /// Index of the first item, counted from the start of the run.
    first: u64,
    /// Number of valid items in `items`.
    length: usize,
    flags: Flags,
    /// Device time of the newest item, microseconds.
    last_us: u64,
    items: [[u8; BYTES]; MAX],
}

/// Samples of all channels, 24 bits per count, for one `Raw` message.
pub type RawChunk = Chunk<{ CHANNELS * COUNT_BYTES }, RAW_SAMPLES>;

/// Filtered steps of all electrodes, for one `Filtered` message.
pub type FilteredChunk = Chunk<{ ELECTRODES * VALUE_BYTES }, FILTERED_STEPS>;

impl<const BYTES: usize, const MAX: usize> Chunk<BYTES, MAX> {
    /// Chunk without items, all zeros.
    pub const EMPTY: Self =
        Self { first: 0, length: 0, flags: Flags::empty(), last_us: 0, items: [[0; BYTES]; MAX] };

    pub(crate) const fn is_full(&self) -> bool {
        self.length == MAX
    }

    /// Returns true if the chunk has items, and the item with this index does not directly follow
    /// the newest one.
    pub(crate) const fn ends_before(&self, index: u64) -> bool {
        self.length > 0 && self.first + self.length as u64 != index
    }

    pub(crate) const fn clear(&mut self) {
        self.length = 0;
    }

    pub(crate) const fn last_us(&self) -> u64 {
        self.last_us
    }

    /// Appends the item `index`, which consists of `values` in little-endian byte order; a full
    /// chunk ignores it.
    fn append<const N: usize>(
        &mut self,
        (index, at_us): (u64, u64),
        flags: Flags,
        values: impl Iterator<Item = [u8; N]>,
    ) {
        if self.length == 0 {
            self.first = index;
            self.flags = Flags::empty();
        }
        let Some(item) = self.items.get_mut(self.length) else {
            return;
        };
        let (places, _) = item.as_chunks_mut();
        for (place, value) in places.iter_mut().zip(values) {
            *place = value;
        }
        self.length += 1;
        self.flags |= flags;
        self.last_us = at_us;
    }

    fn bytes(&self) -> &[u8] {
        let items = self.items.get(..self.length).unwrap_or(&self.items);
        items.as_flattened()
    }
}

impl RawChunk {
    /// Appends a sample, with `marks` as its faults.
    pub(crate) fn append_sample(&mut self, acquired: &AcquiredSample, marks: Marks) {
        let counts = acquired.sample.counts.iter().map(|count| {
            let [low, middle, high, _] = count.to_le_bytes();
            [low, middle, high]
        });
        self.append((acquired.index, acquired.drdy_us), marks.flags(), counts);
    }

    /// Builds the `Raw` message, which borrows the chunk's counts.
    pub fn message(&self) -> Raw<'_> {
        Raw {
            first_sample: self.first,
            channels: const { narrow(CHANNELS) },
            flags: self.flags,
            counts: self.bytes(),
        }
    }
}

impl FilteredChunk {
    /// Appends the step `index`, with `marks` as the faults of its samples.
    pub(crate) fn append_step(&mut self, step: &Step, index: u64, marks: Marks, at_us: u64) {
        let mut flags = marks.flags();
        if step.saturated != 0 {
            flags |= Flags::SATURATED;
        }
        if step.settling {
            flags |= Flags::SETTLING;
        }
        let values = step.electrodes.iter().map(|value| value.to_le_bytes());
        self.append((index, at_us), flags, values);
    }

    /// Builds the `Filtered` message, which borrows the chunk's values.
    pub fn message(&self) -> Filtered<'_> {
        Filtered {
            first_step: self.first,
            electrodes: const { narrow(ELECTRODES) },
            fraction_bits: FRACTION_BITS,
            flags: self.flags,
            values: self.bytes(),
        }
    }
}

/// Converts a dimension of the model to the byte that carries it on the wire; fails to compile if
/// the dimension exceeds a byte.
pub(crate) const fn narrow(dimension: usize) -> u8 {
    assert!(dimension < 256, "the model's dimensions are below 256");
    #[expect(clippy::cast_possible_truncation, reason = "asserted")]
    let narrow = dimension as u8;
    narrow
}

/// The samples of a [`RawChunk`], compressed.
#[derive(Clone, Copy, Debug)]
pub struct CompressedChunk {
    /// Index of the first sample, counted from the start of the run.
    first: u64,
    samples: u8,
    flags: Flags,
    form: BlockForm,
    /// Number of valid bytes at the start of `block`.
    length: usize,
    block: [[Count; CHANNELS]; RAW_SAMPLES],
}

impl CompressedChunk {
    /// Chunk without samples, all zeros.
    const EMPTY: Self = Self {
        first: 0,
        samples: 0,
        flags: Flags::empty(),
        form: BlockForm::Verbatim,
        length: 0,
        block: [[[0; COUNT_BYTES]; CHANNELS]; RAW_SAMPLES],
    };

    /// Builds the `CompressedRaw` message, which borrows the chunk's bytes.
    pub fn message(&self) -> CompressedRaw<'_> {
        let bytes = self.block.as_flattened().as_flattened();
        CompressedRaw {
            first_sample: self.first,
            channels: const { narrow(CHANNELS) },
            flags: self.flags,
            form: self.form,
            samples: self.samples,
            bytes: bytes.get(..self.length).unwrap_or(bytes),
        }
    }
}

/// Compresses the chunks of a run.
#[derive(Clone, Debug)]
pub(crate) struct Compressor {
    state: EncoderState<CHANNELS>,
    /// Index of the sample after the newest chunk.
    next: u64,
    chunk: CompressedChunk,
}

impl Compressor {
    /// Creates a compressor that has no chunk yet. This is a function because a constant would put
    /// the chunk's zeros into flash.
    pub(crate) const fn new() -> Self {
        Self { state: EncoderState::NEW, next: 0, chunk: CompressedChunk::EMPTY }
    }

    /// Starts a run; its first block is a key block.
    pub(crate) const fn restart(&mut self) {
        self.state.require_key();
    }

    /// Returns the newest chunk, compressed.
    pub(crate) const fn chunk(&self) -> &CompressedChunk {
        &self.chunk
    }

    /// Compresses a chunk into a block: a key block if samples are missing before the chunk.
    pub(crate) fn compress(&mut self, raw: &RawChunk) {
        if raw.first != self.next {
            self.state.require_key();
        }
        self.next = raw.first + raw.length as u64;
        let (counts, _) = raw.bytes().as_chunks();
        let (samples, _) = counts.as_chunks();
        let chunk = &mut self.chunk;
        let Block { kind, bytes, .. } = ENCODER.encode(&mut self.state, samples, &mut chunk.block);
        chunk.length = bytes.len();
        chunk.first = raw.first;
        chunk.flags = raw.flags;
        chunk.form = match kind {
            Kind::Verbatim => BlockForm::Verbatim,
            Kind::Key => BlockForm::Key,
            Kind::Continuing => BlockForm::Continuing,
        };
        #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
        let samples = raw.length as u8;
        chunk.samples = samples;
    }
}
