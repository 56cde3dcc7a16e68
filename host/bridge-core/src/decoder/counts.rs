//! Counts of the decoder's work.

use std::fmt;
use std::time::Duration;

/// Number of windows that were decoded and that were not, by reason. Prints as a part of the
/// program's last line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderCounts {
    /// Number of windows decoded so far.
    pub decoded: u64,
    /// Number of windows that wait for the decoder now.
    pub waiting: u64,
    /// Longest time that a window has waited for the decoder.
    pub longest_wait: Duration,
    /// Number of windows replaced by fillers because the decoder's queue was full, and of those that
    /// waited when the program ended.
    pub not_decoded: u64,
    /// Number of windows that were not decoded because `/neurodata_reconstructed` had no
    /// subscriber.
    pub not_needed: u64,
    /// Number of packed blocks that arrived intact, but are no blocks of the model; they count as lost.
    pub malformed: u64,
}

impl fmt::Display for DecoderCounts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "windows: decoded {} not decoded {} not needed {} longest wait {} ms",
            self.decoded,
            self.not_decoded,
            self.not_needed,
            self.longest_wait.as_millis()
        )?;
        if self.malformed > 0 {
            write!(formatter, "; packed blocks malformed {}", self.malformed)?;
        }
        Ok(())
    }
}
