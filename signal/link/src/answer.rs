//! Answers to the host's commands.

use serde::{Deserialize, Serialize};

/// Answer to a command; a device sends exactly one per command received.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ack {
    /// `seq` of the command's frame.
    pub of: u32,
    /// Outcome of the command: done, or the reason why not.
    pub result: AckResult,
}

/// Outcome of a command; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum AckResult {
    /// 0: the device has executed the command, or has accepted it (`SelfTest`, `Reset`).
    Done,
    /// 1: the firmware is older than the host and does not know the command.
    UnknownCommand,
    /// 2: an argument is out of range.
    BadArgument,
    /// 3: not possible now; the same command can succeed later.
    Busy,
    /// 4: the command is known, but this board or model cannot do it.
    NotSupported,
    /// 5: the device tried and failed. No device in this repository sends this result yet.
    Failed,
    /// Any other: a result newer than this host; the command was not executed.
    Newer(u8),
}

impl From<u8> for AckResult {
    fn from(byte: u8) -> AckResult {
        match byte {
            0 => AckResult::Done,
            1 => AckResult::UnknownCommand,
            2 => AckResult::BadArgument,
            3 => AckResult::Busy,
            4 => AckResult::NotSupported,
            5 => AckResult::Failed,
            newer => AckResult::Newer(newer),
        }
    }
}

impl From<AckResult> for u8 {
    fn from(result: AckResult) -> u8 {
        match result {
            AckResult::Done => 0,
            AckResult::UnknownCommand => 1,
            AckResult::BadArgument => 2,
            AckResult::Busy => 3,
            AckResult::NotSupported => 4,
            AckResult::Failed => 5,
            AckResult::Newer(newer) => newer,
        }
    }
}

/// Answer to `SyncTime`, sent before the `Ack` of that command.
///
/// The answer carries two of the four times of a round trip. Its header has the third, when the
/// answer was made; the host records the fourth, when the answer arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClockReading {
    /// Time in the command, microseconds of the host's clock.
    pub host_time_us: u64,
    /// Time at which the device read the command, microseconds since boot.
    pub received_us: u64,
}
