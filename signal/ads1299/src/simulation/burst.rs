//! Data of one sample on MISO, assembled from the frames of the selected chips.

use crate::frame::{CHIP_BYTES, MAX_CHIPS};
use crate::simulation::chip::Chip;
use crate::simulation::fault::Fault;

/// Length of the longest burst in bytes: eight chips, a don't-care bit per chip, and the bit that
/// `Fault::ShiftedBit` inserts.
const BYTES: usize = CHIP_BYTES * MAX_CHIPS + 2;

/// Bits that a chain sends for one sample, from the first selected chip on.
pub(super) struct Burst([u8; BYTES]);

impl Burst {
    /// Builds the burst with `spaced` (0 or 1) don't-care bits between chips.
    pub(super) fn new(chips: &[Chip], spaced: usize) -> Self {
        let mut burst = Self([0; BYTES]);
        let mut place = 0;
        let mut was_late = false;
        // A chip that is dead or not selected blocks the chips after it.
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

    /// ORs eight bits into the burst at bit position `place`.
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

    /// Returns byte `n`; 0 after the end.
    pub(super) fn byte(&self, n: usize) -> u8 {
        self.0.get(n).copied().unwrap_or(0)
    }
}
