//! Who the device is.

use serde::{Deserialize, Serialize};

/// Longest text that [`Hello`], [`Capabilities::filters`](crate::Capabilities),
/// [`Converters`](crate::Converters) and [`SelfTest`](crate::SelfTest) may carry, bytes of UTF-8.
pub const MAX_TEXT_BYTES: usize = 256;

/// Who the device is: sent at start-up and in answer to `Identify`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello<'a> {
    /// Version and commit of the firmware, such as `0.1.0 5d4b736`. At most [`MAX_TEXT_BYTES`].
    pub firmware: &'a str,
    /// Board, such as `nucleo-h743zi2` or `host-sim`. At most [`MAX_TEXT_BYTES`].
    pub board: &'a str,
    /// Unique id of the microcontroller (96 bits on every STM32); a simulator makes one up.
    pub chip_uid: [u8; 12],
    /// First 8 bytes of the SHA-256 over the model.
    pub model_id: [u8; 8],
    /// Differs from boot to boot: a change means that the device was reset.
    pub session_id: u32,
    /// Why the device started.
    pub reset_cause: ResetCause,
    /// What is wrong: a damaged model, a board without its clock, what the last run left when it failed
    /// (panic message, fault registers). Empty when nothing is. At most [`MAX_TEXT_BYTES`].
    pub fault: &'a str,
}

/// Why a device started; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum ResetCause {
    /// 0: the device cannot tell.
    NotKnown,
    /// 1: power came up.
    PowerOn,
    /// 2: the reset pin, or the debugger.
    Pin,
    /// 3: the supply sagged.
    BrownOut,
    /// 4: a watchdog ran out.
    Watchdog,
    /// 5: asked for by software.
    Software,
    /// 6: a fault or a panic; [`Hello::fault`] says which.
    Fault,
    /// Any other: a cause newer than this host.
    Newer(u8),
}

impl From<u8> for ResetCause {
    fn from(byte: u8) -> ResetCause {
        match byte {
            0 => ResetCause::NotKnown,
            1 => ResetCause::PowerOn,
            2 => ResetCause::Pin,
            3 => ResetCause::BrownOut,
            4 => ResetCause::Watchdog,
            5 => ResetCause::Software,
            6 => ResetCause::Fault,
            newer => ResetCause::Newer(newer),
        }
    }
}

impl From<ResetCause> for u8 {
    fn from(cause: ResetCause) -> u8 {
        match cause {
            ResetCause::NotKnown => 0,
            ResetCause::PowerOn => 1,
            ResetCause::Pin => 2,
            ResetCause::BrownOut => 3,
            ResetCause::Watchdog => 4,
            ResetCause::Software => 5,
            ResetCause::Fault => 6,
            ResetCause::Newer(newer) => newer,
        }
    }
}
