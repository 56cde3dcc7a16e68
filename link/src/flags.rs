//! What was wrong with, or special about, one code's window.

use core::ops::{BitOr, BitOrAssign};

use serde::{Deserialize, Serialize};

/// Bit set on every code: what was wrong with, or special about, its window.
///
/// 16 bits, so that it fits one word of the NeuroFrame's `tri` (recorded as float32). Bits that
/// this version does not name are kept as they came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Flags(u16);

impl Flags {
    /// Bit 0: a status word of the ADC chain was wrong at least once (chip dead, data shifted).
    pub const ADC_STATUS_BAD: Flags = Flags(1 << 0);
    /// Bit 1: at least one ADC sample stood at the converter's rail ([`crate::Code::saturated`]).
    pub const SATURATED: Flags = Flags(1 << 1);
    /// Bit 2: the ADC reported at least one electrode off.
    pub const LEAD_OFF: Flags = Flags(1 << 2);
    /// Bit 3: the filters have not settled yet after a start.
    pub const SETTLING: Flags = Flags(1 << 3);
    /// Bit 4: at least one value was clipped on its way into int8 ([`crate::Code::clipped`]).
    pub const CLIPPED: Flags = Flags(1 << 4);
    /// Bit 5: at least one ADC sample of the window was not read in time.
    pub const OVERRUN: Flags = Flags(1 << 5);
    /// Bit 6: at least one value of the code itself was clipped ([`crate::Code::clipped_values`]).
    pub const CODE_CLIPPED: Flags = Flags(1 << 6);
    /// Bit 15: this code was made up by the bridge in place of a lost one. Never set on the wire.
    pub const FILLER: Flags = Flags(1 << 15);

    /// Names of the bits, in the order of the bits.
    pub const NAMES: [(Flags, &'static str); 8] = [
        (Flags::ADC_STATUS_BAD, "adc_status_bad"),
        (Flags::SATURATED, "saturated"),
        (Flags::LEAD_OFF, "lead_off"),
        (Flags::SETTLING, "settling"),
        (Flags::CLIPPED, "clipped"),
        (Flags::OVERRUN, "overrun"),
        (Flags::CODE_CLIPPED, "code_clipped"),
        (Flags::FILLER, "filler"),
    ];

    /// No bit set.
    pub const fn empty() -> Flags {
        Flags(0)
    }

    /// The set with exactly these bits, named ones or not.
    pub const fn from_bits(bits: u16) -> Flags {
        Flags(bits)
    }

    /// The bits, as on the wire.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether every bit of `other` is set.
    pub const fn contains(self, other: Flags) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether no bit is set.
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
