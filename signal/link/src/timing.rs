//! Durations of the stages of the signal path, once a second.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Largest number of stages in a [`Timing`].
pub const MAX_STAGES: usize = 8;

/// Durations of the stages of the signal path since boot. A device that measures them sends this
/// message every second while streaming, after `Stats`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timing {
    /// The stages that are measured, each once, in the order of [`Stage`].
    pub stages: Vec<StageTiming, MAX_STAGES>,
    /// Deepest use of the stack since boot, bytes; 0 on a device that does not measure it.
    pub stack_used: u32,
    /// Size of the stack, bytes; 0 on a device that does not measure its use.
    pub stack_size: u32,
}

/// Durations of one stage since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageTiming {
    /// Stage whose durations these are.
    pub stage: Stage,
    /// Longest allowed duration, nanoseconds; anything longer is late.
    pub deadline_ns: u32,
    /// Longest measured duration, nanoseconds; saturates.
    pub worst_ns: u32,
    /// Number of durations by eighths of the deadline. Element k below 8 counts durations above k/8
    /// and up to (k+1)/8 of the deadline; element 8 counts longer ones. Every element wraps.
    pub histogram: [u32; 9],
}

/// Interval between two points of the signal path; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum Stage {
    /// 0: from a sample's DRDY edge until the sample is in the encoder's queue.
    Acquire,
    /// 1: processing of a sample that completes a step: encoder, reports, streams.
    Step,
    /// 2: from the DRDY edge of a window's last sample until its code is in the output queue.
    Code,
    /// 3: from the entry of a code into the output queue until its frame is written to the port.
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
