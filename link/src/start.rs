//! What the host asks the device to stream.

use core::ops::BitOr;

use serde::{Deserialize, Serialize};

/// Begin streaming; window and sample indices start again at 0. Repeating it while the same
/// streams run is acknowledged and changes nothing, so that a host may send it until it is
/// acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Start {
    /// What to stream; unknown bits are refused with `BadArgument`.
    pub streams: Streams,
    /// Mains for the notch, 50 or 60 Hz; 0 keeps the device's choice. Anything else is refused
    /// with `BadArgument`.
    pub mains_hz: u8,
}

/// Bit set of streams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Streams(u16);

impl Streams {
    /// Bit 0: one [`Code`](crate::Code) per hop.
    pub const CODES: Streams = Streams(1 << 0);
    /// Bit 1: every ADC sample, in [`Raw`](crate::Raw).
    pub const RAW: Streams = Streams(1 << 1);
    /// Bit 2: every filtered step, in [`Filtered`](crate::Filtered).
    pub const FILTERED: Streams = Streams(1 << 2);
    /// Bit 3: a window with its code now and then, in [`Audit`](crate::Audit).
    pub const AUDIT: Streams = Streams(1 << 3);
    /// Bit 4: what happens at the device's inputs, in [`Event`](crate::Event).
    pub const EVENTS: Streams = Streams(1 << 4);

    /// Every stream that this version names.
    pub const ALL: Streams = Streams(0b1_1111);

    /// Nothing runs.
    pub const fn empty() -> Streams {
        Streams(0)
    }

    /// The set with exactly these bits, named ones or not.
    pub const fn from_bits(bits: u16) -> Streams {
        Streams(bits)
    }

    /// The bits, as on the wire.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// This set without the bits of `other`.
    #[must_use]
    pub const fn without(self, other: Streams) -> Streams {
        Streams(self.0 & !other.0)
    }

    /// Whether every bit of `other` is set.
    pub const fn contains(self, other: Streams) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether no bit is set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl BitOr for Streams {
    type Output = Streams;

    fn bitor(self, other: Streams) -> Streams {
        Streams(self.0 | other.0)
    }
}
