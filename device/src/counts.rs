//! What the acquisition counts.

/// What the acquisition has counted since boot; everything wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Samples taken.
    pub samples: u64,
    /// Samples that were not read in time.
    pub overruns: u32,
    /// Samples with a wrong status word.
    pub adc_status_bad: u32,
    /// Values clipped on their way into int8, each once.
    pub clipped: u32,
}
