//! Counters of the device.

use serde::{Deserialize, Serialize};

use crate::command::Streams;

/// Counters of the device since boot; sent every second while streaming, and after `Stop`.
///
/// Every counter wraps; a host computes differences modulo 2^32 (`samples`: 2^64).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stats {
    /// Streams that are running; empty on an idle device.
    pub streams: Streams,
    /// Index of the window of the next code: the number of codes made since `Start`.
    pub next_window: u32,
    /// Codes made since boot, dropped ones included.
    pub codes_made: u32,
    /// Frames that were made, numbered and then dropped because the host did not read them.
    pub frames_dropped: u32,
    /// ADC samples that were read.
    pub samples: u64,
    /// ADC samples that were not read in time.
    pub overruns: u32,
    /// ADC samples with a wrong status word.
    pub adc_status_bad: u32,
    /// Electrode values clipped to int8, each counted once although windows overlap.
    pub clipped: u32,
    /// Values of codes that were clipped to the range of the code's format.
    pub clipped_values: u32,
    /// Commands received intact.
    pub commands: u32,
    /// Frames from the host that were refused, for any [`FrameError`](crate::FrameError).
    pub input_bad: u32,
}
