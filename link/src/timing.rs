//! How long the device's stages took, once a second.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most stages that a [`Timing`] may carry.
pub const MAX_STAGES: usize = 8;

/// How long the device's stages took since boot; sent every second while streaming, after `Stats`,
/// by a device that measures it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timing {
    /// The stages that are measured, each once, in the order of [`Stage`].
    pub stages: Vec<StageTiming, MAX_STAGES>,
    /// Deepest use of the stack since boot, bytes; 0 where nobody measures it.
    pub stack_used: u32,
    /// Size of the stack, bytes; 0 where nobody measures its use.
    pub stack_size: u32,
}

/// How long one stage took since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageTiming {
    /// Which one.
    pub stage: Stage,
    /// Nanoseconds that it may take; more is late.
    pub deadline_ns: u32,
    /// Nanoseconds that it took at most, saturates.
    pub worst_ns: u32,
    /// How often it took up to 1/8, more and up to 2/8, .. more than 7/8 and up to 8/8 of its
    /// deadline, and last how often it was late; each wraps.
    pub histogram: [u32; 9],
}

/// From where to where a time is taken; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum Stage {
    /// 0: from a sample's DRDY edge until the sample is handed on.
    Acquire,
    /// 1: all that is made of a sample with a step: encoder, reports, streams.
    Step,
    /// 2: from the DRDY edge of a window's last sample until its code is handed on.
    Code,
    /// 3: from there until the code's frame is written to the port.
    Send,
    /// Any other: a stage newer than this host.
    Newer(u8),
}

impl fmt::Display for Stage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Stage::Acquire => formatter.write_str("acquire"),
            Stage::Step => formatter.write_str("step"),
            Stage::Code => formatter.write_str("code"),
            Stage::Send => formatter.write_str("send"),
            Stage::Newer(number) => write!(formatter, "stage {number}"),
        }
    }
}

impl From<u8> for Stage {
    fn from(byte: u8) -> Stage {
        match byte {
            0 => Stage::Acquire,
            1 => Stage::Step,
            2 => Stage::Code,
            3 => Stage::Send,
            newer => Stage::Newer(newer),
        }
    }
}

impl From<Stage> for u8 {
    fn from(stage: Stage) -> u8 {
        match stage {
            Stage::Acquire => 0,
            Stage::Step => 1,
            Stage::Code => 2,
            Stage::Send => 3,
            Stage::Newer(newer) => newer,
        }
    }
}
