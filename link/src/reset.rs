//! What the device starts anew with.

use serde::{Deserialize, Serialize};

/// What the device starts anew with; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum ResetInto {
    /// 0: the firmware.
    Firmware,
    /// 1: the microcontroller's own loader, which takes new firmware over USB.
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
