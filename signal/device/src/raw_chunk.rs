//! Consecutive unfiltered samples for one `Raw` message.

use link::{COUNT_BYTES, RAW_SAMPLES, Raw};
use model::CHANNELS;
use pipeline::Sample;

use crate::marks::Marks;

/// Up to [`RAW_SAMPLES`] consecutive samples, packed to 24 bits per count.
#[derive(Clone, Debug)]
pub struct RawChunk {
    first: u64,
    samples: usize,
    marks: Marks,
    /// Device time of the newest sample in the chunk, microseconds.
    last_us: u64,
    counts: [[[u8; COUNT_BYTES]; CHANNELS]; RAW_SAMPLES],
}

impl RawChunk {
    pub(crate) const EMPTY: Self = Self {
        first: 0,
        samples: 0,
        marks: Marks::NONE,
        last_us: 0,
        counts: [[[0; COUNT_BYTES]; CHANNELS]; RAW_SAMPLES],
    };

    pub(crate) const fn is_empty(&self) -> bool {
        self.samples == 0
    }

    pub(crate) const fn is_full(&self) -> bool {
        self.samples == RAW_SAMPLES
    }

    /// Returns true if the sample `index` directly follows the newest sample in the chunk.
    pub(crate) const fn continues_with(&self, index: u64) -> bool {
        self.first + self.samples as u64 == index
    }

    pub(crate) const fn clear(&mut self) {
        self.samples = 0;
    }

    /// Appends a sample. A full chunk ignores it.
    pub(crate) fn append(&mut self, sample: &Sample, index: u64, marks: Marks, at_us: u64) {
        if self.samples == 0 {
            self.first = index;
            self.marks = Marks::NONE;
        }
        let Some(places) = self.counts.get_mut(self.samples) else {
            return;
        };
        for (place, count) in places.iter_mut().zip(&sample.counts) {
            let [low, middle, high, _] = count.to_le_bytes();
            *place = [low, middle, high];
        }
        self.samples += 1;
        self.marks = self.marks.union(marks);
        self.last_us = at_us;
    }

    pub(crate) const fn last_us(&self) -> u64 {
        self.last_us
    }

    /// Returns the samples of the chunk.
    pub(crate) fn samples(&self) -> &[[[u8; COUNT_BYTES]; CHANNELS]] {
        self.counts.get(..self.samples).unwrap_or(&self.counts)
    }

    /// Builds the `Raw` message, which borrows the chunk's counts.
    pub(crate) fn message(&self) -> Raw<'_> {
        Raw {
            first_sample: self.first,
            #[expect(clippy::cast_possible_truncation, reason = "at most 64")]
            channels: const { CHANNELS as u8 },
            flags: self.marks.flags(),
            counts: self.samples().as_flattened().as_flattened(),
        }
    }
}
