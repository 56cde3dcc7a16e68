//! Status flags of a window or of samples.

use core::ops::{BitOr, BitOrAssign};

use serde::{Deserialize, Serialize};

/// Faults and conditions, such as clipping, of a code's window or of the samples in a message: one
/// bit for each.
///
/// The 16 bits are one word of the NeuroFrame's `tri`, which a recorder stores as float32 without
/// loss. Bits that this version does not name are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Flags(u16);

impl Flags {
    /// Bit 0: a status word of the ADC chain was wrong at least once (chip dead, data shifted).
    pub const ADC_STATUS_BAD: Flags = Flags(1 << 0);
    /// Bit 1: at least one ADC sample reached the converter's rail ([`crate::Code::saturated`]).
    pub const SATURATED: Flags = Flags(1 << 1);
    /// Bit 2: the ADC reported lead-off, an electrode without contact, on at least one channel.
    pub const LEAD_OFF: Flags = Flags(1 << 2);
    /// Bit 3: the filters have not settled yet after a start.
    pub const SETTLING: Flags = Flags(1 << 3);
    /// Bit 4: at least one electrode value was clipped to int8 ([`crate::Code::clipped`]).
    pub const CLIPPED: Flags = Flags(1 << 4);
    /// Bit 5: at least one ADC sample of the window was not read in time.
    pub const OVERRUN: Flags = Flags(1 << 5);
    /// Bit 6: at least one value of the code was clipped ([`crate::Code::clipped_values`]).
    pub const CODE_CLIPPED: Flags = Flags(1 << 6);
    /// Bit 7: the model does not represent the block of the packed code well: an electrode without contact, or
    /// another cap.
    pub const MISFIT: Flags = Flags(1 << 7);
    /// Bit 8: the block of the packed code was too long and has no content; its signals are a prediction.
    pub const BLANK: Flags = Flags(1 << 8);
    /// Bit 14: blocks of the packed code were lost before this one, and the bridge's state has not healed yet. Never
    /// set on the wire.
    pub const HEALING: Flags = Flags(1 << 14);
    /// Bit 15: the bridge inserted this code or block for a lost one. Never set on the wire.
    pub const FILLER: Flags = Flags(1 << 15);

    /// Names of the flags, in the order of their bits.
    pub const NAMES: [(Flags, &'static str); 11] = [
        (Flags::ADC_STATUS_BAD, "adc_status_bad"),
        (Flags::SATURATED, "saturated"),
        (Flags::LEAD_OFF, "lead_off"),
        (Flags::SETTLING, "settling"),
        (Flags::CLIPPED, "clipped"),
        (Flags::OVERRUN, "overrun"),
        (Flags::CODE_CLIPPED, "code_clipped"),
        (Flags::MISFIT, "misfit"),
        (Flags::BLANK, "blank"),
        (Flags::HEALING, "healing"),
        (Flags::FILLER, "filler"),
    ];

    /// Returns the empty set, which a window without faults has.
    pub const fn empty() -> Flags {
        Flags(0)
    }

    /// Builds a set from its wire representation; bits without a name are kept.
    pub const fn from_bits(bits: u16) -> Flags {
        Flags(bits)
    }

    /// Returns the wire representation, bits without a name included.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Returns true if every flag of `other` is in this set.
    pub const fn contains(self, other: Flags) -> bool {
        self.0 & other.0 == other.0
    }

    /// Returns true if no bit is set, named or not.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl BitOr for Flags {
    type Output = Flags;

    fn bitor(self, other: Flags) -> Flags {
        Flags(self.0 | other.0)
    }
}

impl BitOrAssign for Flags {
    fn bitor_assign(&mut self, other: Flags) {
        self.0 |= other.0;
    }
}
