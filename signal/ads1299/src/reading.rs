//! Result of reading one sample from a chain of ADS1299 chips.

use crate::decoder::FrameStatus;
use crate::ready::RateError;

/// Result of reading one sample: bad chips, missed samples, and the error of the sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading<const CHIPS: usize> {
    /// Status words of the frame; `None` if no frame was read because DRDY had no edge, the bus
    /// failed, or the chain is stopped.
    pub status: Option<FrameStatus<CHIPS>>,
    /// Bad chips, one bit each. The counts of a bad chip are those of an earlier sample.
    pub bad: u8,
    /// Samples missing between the previous reading and this one.
    pub missed: u32,
    /// Error of the sample rate, if any; it names the chip whose DRDY is wired. The counts are
    /// valid nevertheless.
    pub rate: Option<RateError>,
}

impl<const CHIPS: usize> Reading<CHIPS> {
    /// Mask with a 1 for every chip of the chain.
    pub(crate) const ALL: u8 = u8::MAX >> (8 - CHIPS);

    /// Returns whether no chip is bad and the sample rate is right; missed samples do not matter.
    pub const fn is_sound(&self) -> bool {
        self.bad == 0 && self.rate.is_none()
    }

    /// Returns the positive inputs of a chip at which an electrode is disconnected, one bit each; 0
    /// for a bad chip.
    pub fn off_positive(&self, chip: usize) -> u8 {
        self.sound_word(chip).map_or(0, StatusWord::off_positive)
    }

    /// Returns the negative inputs of a chip at which an electrode is disconnected, one bit each; 0
    /// for a bad chip.
    pub fn off_negative(&self, chip: usize) -> u8 {
        self.sound_word(chip).map_or(0, StatusWord::off_negative)
    }

    /// Returns whether an electrode is disconnected at any chip; bad chips are ignored.
    pub fn lead_off(&self) -> bool {
        (0..CHIPS).fold(0, |off, chip| off | self.off_positive(chip) | self.off_negative(chip)) != 0
    }

    fn sound_word(&self, chip: usize) -> Option<StatusWord> {
        let is_sound = self.bad >> chip & 1 == 0;
        let words = self.status.as_ref().filter(|_| is_sound)?.words;
        words.get(chip).copied()
    }
}

/// 24-bit word that a chip sends before its counts (data sheet section 9.4.4): 1100, LOFF_STATP,
/// LOFF_STATN, GPIO data, from the most significant bit. The upper 8 bits of the `u32` are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusWord(pub u32);

/// Upper four bits of every valid status word.
pub(crate) const NIBBLE: u8 = 0b1100;

impl StatusWord {
    /// Returns the upper four bits, 1100 in a valid word.
    pub const fn nibble(self) -> u8 {
        (self.0 >> 20 & 0xF) as u8
    }

    /// Returns the positive inputs with a disconnected electrode, one bit each (LOFF_STATP).
    pub const fn off_positive(self) -> u8 {
        (self.0 >> 12 & 0xFF) as u8
    }

    /// Returns the negative inputs with a disconnected electrode, one bit each (LOFF_STATN).
    pub const fn off_negative(self) -> u8 {
        (self.0 >> 4 & 0xFF) as u8
    }
}
