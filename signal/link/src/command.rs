//! Arguments of the host's commands.

use core::ops::BitOr;

use serde::{Deserialize, Serialize};

/// Arguments of `Start`, which starts the streams and sets the indices of windows and samples to 0.
///
/// A `Start` with the streams and the mains frequency that are already active is acknowledged and
/// changes nothing, so a host can repeat a `Start` until the acknowledgement arrives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Start {
    /// Streams to send; unknown bits are refused with `BadArgument`.
    pub streams: Streams,
    /// Mains frequency of the notch, 50 or 60 Hz; 0 keeps the active one. Any other value is
    /// refused with `BadArgument`.
    pub mains_hz: u8,
}

/// Set of streams, one bit for each.
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
    /// Bit 3: every ten seconds the planes of a window with its code, in [`Audit`](crate::Audit).
    pub const AUDIT: Streams = Streams(1 << 3);
    /// Bit 4: edges at the device's inputs, in [`Event`](crate::Event).
    pub const EVENTS: Streams = Streams(1 << 4);
    /// Bit 5: every ADC sample, compressed without loss, in [`CompressedRaw`](crate::CompressedRaw).
    pub const COMPRESSED_RAW: Streams = Streams(1 << 5);
    /// Bit 6: one [`PackedCode`](crate::PackedCode) per hop.
    pub const PACKED: Streams = Streams(1 << 6);

    /// Every stream that this version names.
    pub const ALL: Streams = Streams(0b111_1111);

    /// Returns the empty set, the streams of an idle device.
    pub const fn empty() -> Streams {
        Streams(0)
    }

    /// Builds a set from its wire representation; bits without a name are kept.
    pub const fn from_bits(bits: u16) -> Streams {
        Streams(bits)
    }

    /// Returns the wire representation, bits without a name included.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Returns this set minus the streams of `other`.
    #[must_use]
    pub const fn without(self, other: Streams) -> Streams {
        Streams(self.0 & !other.0)
    }

    /// Returns true if every stream of `other` is in this set.
    pub const fn contains(self, other: Streams) -> bool {
        self.0 & other.0 == other.0
    }

    /// Returns true if no bit is set, named or not.
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

/// Program that a `Reset` starts; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum ResetInto {
    /// 0: the application, restarted.
    Firmware,
    /// 1: the microcontroller's built-in boot loader, which accepts new firmware over USB.
    Bootloader,
    /// Any other: refused with `BadArgument`.
    Newer(u8),
}

impl From<u8> for ResetInto {
    fn from(byte: u8) -> ResetInto {
        match byte {
            0 => ResetInto::Firmware,
            1 => ResetInto::Bootloader,
            newer => ResetInto::Newer(newer),
        }
    }
}

impl From<ResetInto> for u8 {
    fn from(into: ResetInto) -> u8 {
        match into {
            ResetInto::Firmware => 0,
            ResetInto::Bootloader => 1,
            ResetInto::Newer(newer) => newer,
        }
    }
}
