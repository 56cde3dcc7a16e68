//! What a chain sends for a sample.

use crate::simulation::Fault;
use crate::simulation::chip::Chip;
use crate::{CHIP_BYTES, MAX_CHIPS};

/// Bytes of the longest burst, with a don't-care bit for each chip and a late one.
const BYTES: usize = CHIP_BYTES * MAX_CHIPS + 2;

/// What a chain sends for a sample: the chips from the first selected one on.
pub(super) struct Burst([u8; BYTES]);

impl Burst {
    /// With so many don't-care bits, 0 or 1, between two chips.
    pub(super) fn new(chips: &[Chip], spaced: usize) -> Self {
        let mut burst = Self([0; BYTES]);
        let mut place = 0;
        let mut was_late = false;
        // Nothing gets past a chip that is dead or not selected.
        let chips = chips
            .iter()
            .take_while(|chip| chip.selected && !chip.is_dead());
        for (index, chip) in chips.enumerate() {
            if chip.fault == Some(Fault::ShiftedBit) && !was_late {
                was_late = true;
                place += 1;
            }
            for byte in chip.frame {
                burst.put(place, byte);
                place += 8;
            }
            if spaced > 0 && index.is_multiple_of(2) {
                burst.put(place, 0x80);
            }
            place += spaced;
        }
        burst
    }

    /// Lays eight bits at a bit's place.
    fn put(&mut self, place: usize, bits: u8) {
        let both = u16::from(bits) << (8 - place % 8);
        let [first, second] = both.to_be_bytes();
        if let Some(byte) = self.0.get_mut(place / 8) {
            *byte |= first;
        }
        if let Some(byte) = self.0.get_mut(place / 8 + 1) {
            *byte |= second;
        }
    }

    /// The n-th byte; 0 behind the end.
    pub(super) fn byte(&self, n: usize) -> u8 {
        self.0.get(n).copied().unwrap_or(0)
    }
}
