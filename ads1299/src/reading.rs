//! What was found with a sample.

use crate::decoder::FrameStatus;
use crate::ready::RateError;
use crate::status_word::StatusWord;

/// What was found with a sample, chip by chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading<const CHIPS: usize> {
    /// What stood beside the counts; none if there was no frame: the bus failed, or nothing converts.
    pub status: Option<FrameStatus<CHIPS>>,
    /// Chips whose counts are not of this sample, one bit each: they keep those of before.
    pub bad: u8,
    /// Samples between the one before and this one that nobody read.
    pub missed: u32,
    /// Why the rate is not what was set; it names the chip whose DRDY is wired. The counts are what
    /// the chips delivered.
    pub rate: Option<RateError>,
}

impl<const CHIPS: usize> Reading<CHIPS> {
    /// One bit for each chip.
    pub(crate) const ALL: u8 = u8::MAX >> (8 - CHIPS);

    /// Whether every chip is sound and the rate is right; missed samples are another matter.
    pub const fn is_sound(&self) -> bool {
        self.bad == 0 && self.rate.is_none()
    }

    /// The chip with which the trouble begins: those behind a dead one are silenced by it.
    #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
    pub fn culprit(&self) -> Option<u8> {
        let of_frame = (self.bad != 0).then(|| self.bad.trailing_zeros() as u8);
        of_frame.or_else(|| self.rate.map(|error| error.chip()))
    }

    /// Positive inputs of a chip without contact, one bit each; none of a chip that is bad.
    pub fn off_positive(&self, chip: usize) -> u8 {
        self.sound_word(chip).map_or(0, StatusWord::off_positive)
    }

    /// Negative inputs of a chip without contact, one bit each; none of a chip that is bad.
    pub fn off_negative(&self, chip: usize) -> u8 {
        self.sound_word(chip).map_or(0, StatusWord::off_negative)
    }

    /// Whether any electrode is without contact.
    pub fn lead_off(&self) -> bool {
        (0..CHIPS).fold(0, |off, chip| {
            off | self.off_positive(chip) | self.off_negative(chip)
        }) != 0
    }

    fn sound_word(&self, chip: usize) -> Option<StatusWord> {
        let is_sound = self.bad >> chip & 1 == 0;
        let words = self.status.as_ref().filter(|_| is_sound)?.words;
        words.get(chip).copied()
    }
}
