//! Result of reading one sample.

use crate::decoder::FrameStatus;
use crate::ready::RateError;
use crate::status_word::StatusWord;

/// Result of reading one sample: bad chips, missed samples, and the error of the sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading<const CHIPS: usize> {
    /// Status words of the frame; `None` if no frame was read because DRDY was silent, the bus failed,
    /// or the chain is stopped.
    pub status: Option<FrameStatus<CHIPS>>,
    /// Bad chips, one bit each. The sampler keeps their counts from an earlier sample.
    pub bad: u8,
    /// Samples missing between the previous reading and this one.
    pub missed: u32,
    /// Error of the sample rate, if any; it names the chip whose DRDY is wired. The counts are valid
    /// nevertheless.
    pub rate: Option<RateError>,
}

impl<const CHIPS: usize> Reading<CHIPS> {
    /// Mask with a 1 for every chip of the chain.
    pub(crate) const ALL: u8 = u8::MAX >> (8 - CHIPS);

    /// Returns whether no chip is bad and the sample rate is right; true also after missed samples.
    pub const fn is_sound(&self) -> bool {
        self.bad == 0 && self.rate.is_none()
    }

    /// Returns the chip that caused the fault. It is the first bad chip, because a dead chip also
    /// silences those that send through it; without a bad chip, it is the chip of a rate error.
    #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
    pub fn culprit(&self) -> Option<u8> {
        let of_frame = (self.bad != 0).then(|| self.bad.trailing_zeros() as u8);
        of_frame.or_else(|| self.rate.map(|error| error.chip()))
    }

    /// Returns the positive inputs of a chip at which an electrode is disconnected, one bit each; 0 for
    /// a bad chip.
    pub fn off_positive(&self, chip: usize) -> u8 {
        self.sound_word(chip).map_or(0, StatusWord::off_positive)
    }

    /// Returns the negative inputs of a chip at which an electrode is disconnected, one bit each; 0 for
    /// a bad chip.
    pub fn off_negative(&self, chip: usize) -> u8 {
        self.sound_word(chip).map_or(0, StatusWord::off_negative)
    }

    /// Returns whether an electrode of any chip that is not bad is disconnected.
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
