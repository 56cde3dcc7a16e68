//! What the user chooses.

use clap::ValueEnum;
use link::Streams;

/// What the user chooses about the frames; never changes while the bridge runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// What a frame's stamp is the time of.
    pub stamp: StampPoint,
    /// Mains that the device shall remove, Hz; 0 leaves it to the device.
    pub mains_hz: u8,
    /// What stands in for a lost code, sample or step.
    pub filler: FillerPolicy,
    /// Reconstruct from the newest window alone instead of waiting one hop for the next.
    pub low_latency: bool,
    /// Which stream `/acquisition/get_info` announces.
    pub announced: AnnouncedStream,
    /// What the device is asked to stream; codes always.
    pub streams: Streams,
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
    /// `/neurodata`: the ADC's samples in microvolts.
    Raw,
    /// `/neurodata_filtered`: what the encoder reads, in microvolts.
    Filtered,
}

impl AnnouncedStream {
    /// What the device has to stream for it.
    pub fn needs(self) -> Streams {
        match self {
            AnnouncedStream::Encoded | AnnouncedStream::Reconstructed => Streams::CODES,
            AnnouncedStream::Raw => Streams::RAW,
            AnnouncedStream::Filtered => Streams::FILTERED,
        }
    }
}

/// One of the device's streams.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum StreamKind {
    /// `/encoded` and `/neurodata_reconstructed`; always on.
    Codes,
    /// `/neurodata`: every ADC sample, 101 kB/s.
    Raw,
    /// `/neurodata_filtered`: every step that the encoder reads, 33 kB/s.
    Filtered,
    /// Every 10 s a window with its code, which is computed again here; the result goes to
    /// /diagnostics.
    Audit,
    /// `/events/bus`: edges of the trigger input.
    Events,
}

impl StreamKind {
    /// Every stream, in the order of the wire's bits.
    pub const ALL: [StreamKind; 5] = [
        StreamKind::Codes,
        StreamKind::Raw,
        StreamKind::Filtered,
        StreamKind::Audit,
        StreamKind::Events,
    ];

    /// The stream's bit on the wire.
    pub fn bit(self) -> Streams {
        match self {
            StreamKind::Codes => Streams::CODES,
            StreamKind::Raw => Streams::RAW,
            StreamKind::Filtered => Streams::FILTERED,
            StreamKind::Audit => Streams::AUDIT,
            StreamKind::Events => Streams::EVENTS,
        }
    }

    /// The names of the streams of a set, blank-separated.
    pub fn names(streams: Streams) -> String {
        let named = StreamKind::ALL.map(|kind| {
            let name = match kind {
                StreamKind::Codes => "codes",
                StreamKind::Raw => "raw",
                StreamKind::Filtered => "filtered",
                StreamKind::Audit => "audit",
                StreamKind::Events => "events",
            };
            streams.contains(kind.bit()).then_some(name)
        });
        let named: Vec<&str> = named.into_iter().flatten().collect();
        named.join(" ")
    }
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

/// What stands in for a lost code, sample or step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum FillerPolicy {
    /// The last one that came.
    #[default]
    Last,
    /// Zeros.
    Zeros,
    /// Nothing: a gap, which shifts later samples against events in a recorder. A frame that would
    /// hold a made-up sample does not come at all.
    Off,
}
