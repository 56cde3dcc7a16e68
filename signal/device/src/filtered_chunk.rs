//! Consecutive filtered steps for one `Filtered` message.

use link::{FILTERED_STEPS, Filtered, Flags, VALUE_BYTES};
use model::ELECTRODES;
use pipeline::Step;

use crate::marks::Marks;

const STEP_BYTES: usize = ELECTRODES * VALUE_BYTES;

/// Fraction bits of an electrode's filtered value (format Q27.5).
const FRACTION_BITS: u8 = 5;

/// Up to [`FILTERED_STEPS`] consecutive steps in their wire format.
#[derive(Clone, Debug)]
pub struct FilteredChunk {
    first: u64,
    steps: usize,
    flags: Flags,
    /// Device time of the newest step in the chunk, microseconds.
    last_us: u64,
    values: [u8; FILTERED_STEPS * STEP_BYTES],
}

impl FilteredChunk {
    pub(crate) const EMPTY: Self = Self {
        first: 0,
        steps: 0,
        flags: Flags::empty(),
        last_us: 0,
        values: [0; FILTERED_STEPS * STEP_BYTES],
    };

    pub(crate) const fn is_empty(&self) -> bool {
        self.steps == 0
    }

    pub(crate) const fn is_full(&self) -> bool {
        self.steps == FILTERED_STEPS
    }

    /// Returns true if the step `index` directly follows the newest step in the chunk.
    pub(crate) const fn continues_with(&self, index: u64) -> bool {
        self.first + self.steps as u64 == index
    }

    pub(crate) const fn clear(&mut self) {
        self.steps = 0;
    }

    /// Appends a step. A full chunk ignores it.
    pub(crate) fn append(&mut self, step: &Step, index: u64, marks: Marks, at_us: u64) {
        if self.steps == 0 {
            self.first = index;
            self.flags = Flags::empty();
        }
        let room = self.values.chunks_exact_mut(STEP_BYTES).nth(self.steps);
        let Some(room) = room else { return };
        let (places, _) = room.as_chunks_mut::<VALUE_BYTES>();
        for (place, value) in places.iter_mut().zip(&step.electrodes) {
            *place = value.to_le_bytes();
        }
        self.steps += 1;
        self.flags |= marks.flags();
        if step.saturated != 0 {
            self.flags |= Flags::SATURATED;
        }
        if step.settling {
            self.flags |= Flags::SETTLING;
        }
        self.last_us = at_us;
    }

    pub(crate) const fn last_us(&self) -> u64 {
        self.last_us
    }

    /// Builds the `Filtered` message, which borrows the chunk's values.
    pub(crate) fn message(&self) -> Filtered<'_> {
        Filtered {
            first_step: self.first,
            #[expect(clippy::cast_possible_truncation, reason = "at most 64")]
            electrodes: const { ELECTRODES as u8 },
            fraction_bits: FRACTION_BITS,
            flags: self.flags,
            values: &self.values[..self.steps * STEP_BYTES],
        }
    }
}
