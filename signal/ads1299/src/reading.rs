//! Result of reading one sample from a chain of ADS1299 chips.

use core::fmt;

use crate::decoder::FrameStatus;
use crate::ready::RateError;

/// Result of reading one sample: bad chips, missed samples, and the error of the sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading<const CHIPS: usize> {
    /// Status words of the frame; `None` if no frame was read because DRDY was silent, the bus
    /// failed, or the chain is stopped.
    pub status: Option<FrameStatus<CHIPS>>,
    /// Bad chips, one bit each. The sampler keeps their counts from an earlier sample.
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

    /// Returns the chip that caused the fault. It is the first bad chip, because a dead chip also
    /// silences those that send through it; without a bad chip, it is the chip of a rate error.
    #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
    pub fn culprit(&self) -> Option<u8> {
        let of_frame = (self.bad != 0).then(|| self.bad.trailing_zeros() as u8);
        of_frame.or_else(|| self.rate.map(|error| error.chip()))
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

/// Word of 24 bits that a chip sends before its counts (data sheet section 9.4.4): 1100,
/// LOFF_STATP, LOFF_STATN, GPIO data, from the most significant bit. The upper 8 bits of the `u32`
/// are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusWord(pub u32);

/// Upper four bits of every valid status word.
pub(crate) const NIBBLE: u8 = 0b1100;

/// Fault of a chip that its status word, or the repetition of its counts, shows in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipFault {
    /// All 24 bits of the status word are 0: no power, no clock, not selected, or DOUT held low.
    OnlyZeros,
    /// All 24 bits of the status word are 1: nothing drives MISO.
    OnlyOnes,
    /// The status word's first bits, 1100, are one to three bits late, because of extra clock
    /// edges; holds the number of bits.
    Late(u8),
    /// The status word's first bits, 1100, are one bit early, because a clock edge was lost.
    Early,
    /// The upper four bits of the status word have this value instead of 1100, and no other variant
    /// applies.
    Nibble(u8),
    /// More channels repeat their counts exactly than chance explains. Channels at a rail or at 0
    /// are not counted.
    Repeated,
}

impl StatusWord {
    /// Returns the upper four bits, 1100 in a valid word.
    pub const fn nibble(self) -> u8 {
        (self.0 >> 20 & 0xF) as u8
    }

    /// Returns the positive inputs at which an electrode is disconnected, one bit each
    /// (LOFF_STATP).
    pub const fn off_positive(self) -> u8 {
        (self.0 >> 12 & 0xFF) as u8
    }

    /// Returns the negative inputs at which an electrode is disconnected, one bit each
    /// (LOFF_STATN).
    pub const fn off_negative(self) -> u8 {
        (self.0 >> 4 & 0xFF) as u8
    }

    /// Returns the fault that the first bits of the word show; `None` if the first four are 1100.
    pub const fn fault(self) -> Option<ChipFault> {
        let nibble = self.nibble();
        if nibble == NIBBLE {
            return None;
        }
        Some(match self.0 {
            0 => ChipFault::OnlyZeros,
            0xFF_FFFF => ChipFault::OnlyOnes,
            word if word >> 19 & 0xF == NIBBLE as u32 => ChipFault::Late(1),
            word if word >> 18 & 0xF == NIBBLE as u32 => ChipFault::Late(2),
            word if word >> 17 & 0xF == NIBBLE as u32 => ChipFault::Late(3),
            word if word >> 21 == 0b100 => ChipFault::Early,
            _ => ChipFault::Nibble(nibble),
        })
    }
}

impl fmt::Display for ChipFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OnlyZeros => formatter.write_str(
                "only zeros: no power, no clock, not selected, or DOUT held low; check its supplies, \
                 CLK and chip select",
            ),
            Self::OnlyOnes => formatter.write_str(
                "only ones: nothing drives its line; check DOUT, and DAISY_IN of the chip before",
            ),
            Self::Late(bits) => write!(
                formatter,
                "its data come {bits} bit late: clock edges without data; check SCLK for ringing, \
                 and try a slower one"
            ),
            Self::Early => formatter.write_str(
                "its data come a bit early: a clock edge was lost; check SCLK, and try a slower one",
            ),
            Self::Nibble(nibble) => write!(
                formatter,
                "status 0b{nibble:04b} instead of 0b1100: damaged bits, or read while the next \
                 sample came; check SCLK, and how late the frame is read"
            ),
            Self::Repeated => formatter.write_str(
                "the same bits as before: it converts no more; check its START and CLK",
            ),
        }
    }
}
