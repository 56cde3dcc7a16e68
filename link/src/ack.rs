//! The answer to every command.

use serde::{Deserialize, Serialize};

/// The answer to every command, once per command received.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ack {
    /// `seq` of the command's frame.
    pub of: u32,
    /// What became of it.
    pub result: AckResult,
}

/// What became of a command; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum AckResult {
    /// 0: done.
    Done,
    /// 1: the firmware does not know the command: it is older than the host.
    UnknownCommand,
    /// 2: a value is out of its range.
    BadArgument,
    /// 3: not now; the same command may work later.
    Busy,
    /// 4: the command is known, but this board or model cannot do it.
    NotSupported,
    /// 5: tried and failed; `Stats` or the next `Hello` says more.
    Failed,
    /// Any other: a result newer than this host; not done.
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
