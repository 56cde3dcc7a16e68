//! How the chain of converters is.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::MAX_TEXT_BYTES;

/// Most chips of a chain.
pub const MAX_CHIPS: usize = 8;

/// How the chain of converters is: sent after [`Capabilities`](crate::Capabilities) and every second
/// while streaming, by a device that has a chain.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Converters {
    /// What was wrong when the chain was brought up, in words that name the chip; empty where all is
    /// well.
    pub fault: String<MAX_TEXT_BYTES>,
    /// Rate of DRDY's edges since the chain was started, millihertz; 0 where it is not known.
    pub ready_mhz: u32,
    /// ADC channels whose positive electrode is off in the newest sample; bit = channel.
    pub off_positive: u64,
    /// ADC channels whose negative electrode is off in the newest sample; bit = channel.
    pub off_negative: u64,
    /// Of each chip, the first being the one at MISO: frames that were not to be trusted, since boot;
    /// wraps.
    pub frames_bad: Vec<u32, MAX_CHIPS>,
}
