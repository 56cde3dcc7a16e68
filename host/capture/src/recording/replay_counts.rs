//! What a replay has sent.

/// Counts of what a replay has sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReplayCounts {
    /// Number of frames sent, answers included.
    pub frames: u64,
    /// Number of codes sent.
    pub codes: u64,
    /// Number of packed blocks sent.
    pub blocks: u64,
    /// Number of recorded frames that are damaged, or newer than this program, and were left out.
    pub unusable: u64,
}
