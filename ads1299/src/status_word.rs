//! The 24 bits before a chip's counts.

use core::fmt;

/// The 24 bits before a chip's counts (9.4.4): 1100, LOFF_STATP, LOFF_STATN, GPIO data; 24 bits in
/// 32, the upper 8 are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusWord(pub u32);

/// The upper four bits of every status word.
pub(crate) const NIBBLE: u8 = 0b1100;

/// What is wrong with a chip in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipFault {
    /// Only zeros: no power, no clock, not selected, or DOUT held low.
    OnlyZeros,
    /// Only ones: nothing drives the line.
    OnlyOnes,
    /// 1100 stands one to three bits too far back: clock edges without data.
    Late(u8),
    /// 1100 stands a bit too far in front: a clock edge was lost.
    Early,
    /// Something else than 1100.
    Nibble(u8),
    /// Status and counts are those of the frames before, to the last bit, in more channels than chance
    /// explains; those at a rail or at 0 do not count.
    Repeated,
}

impl StatusWord {
    /// The upper four bits; 1100 if all is well.
    pub const fn nibble(self) -> u8 {
        (self.0 >> 20 & 0xF) as u8
    }

    /// Positive inputs without contact, one bit each (LOFF_STATP).
    pub const fn off_positive(self) -> u8 {
        (self.0 >> 12 & 0xFF) as u8
    }

    /// Negative inputs without contact, one bit each (LOFF_STATN).
    pub const fn off_negative(self) -> u8 {
        (self.0 >> 4 & 0xFF) as u8
    }

    /// GPIO4 to GPIO1, one bit each.
    pub const fn gpio(self) -> u8 {
        (self.0 & 0xF) as u8
    }

    /// What is wrong with the upper four bits, and what the bits around them say about it.
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
