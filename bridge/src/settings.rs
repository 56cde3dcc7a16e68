//! What the user chooses.

use clap::ValueEnum;

/// What the user chooses about the frames; never changes while the bridge runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// What a frame's stamp is the time of.
    pub stamp: StampPoint,
    /// Mains that the device shall remove, Hz; 0 leaves it to the device.
    pub mains_hz: u8,
    /// What stands in for a lost code.
    pub filler: FillerPolicy,
    /// Reconstruct from the newest window alone instead of waiting one hop for the next.
    pub low_latency: bool,
    /// Which stream `/acquisition/get_info` announces.
    pub announced: AnnouncedStream,
}

/// Which stream `/acquisition/get_info` announces, for ROS-Neuro's recorder and filters, which
/// take exactly one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum AnnouncedStream {
    /// `/encoded`: 128 values per code.
    #[default]
    Encoded,
    /// `/neurodata_reconstructed`: electrodes in microvolts.
    Reconstructed,
}

/// What a frame's stamp is the time of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum StampPoint {
    /// The frame's first sample, on the scalp (filter delay taken out).
    #[default]
    First,
    /// The frame's last sample, on the scalp (filter delay taken out).
    Last,
    /// The moment when the bridge read the frame, by the host's wall clock alone.
    Arrival,
}

/// What stands in for a lost code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum FillerPolicy {
    /// The last code that came.
    #[default]
    Last,
    /// Zeros.
    Zeros,
    /// Nothing: a gap, which shifts later samples against events in a recorder.
    Off,
}
