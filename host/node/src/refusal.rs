//! The reasons for which a frame of the acquisition is refused.

use recordings::{MontageMapError, RecordingError};
use thiserror::Error;

use crate::layout::RATES_HZ;

/// Why a frame of the acquisition is not encoded. A refused frame counts as lost.
#[derive(Debug, Error)]
pub enum Refusal {
    /// The message is no `NeuroFrame`.
    #[error("a message is no NeuroFrame ({0}); publish rosneuro_msgs/NeuroFrame")]
    Message(#[from] neuro_ros::WireError),
    /// The rate, Hz, is outside the supported range.
    #[error(
        "the rate is {0} Hz; set sr to the sampling rate of the amplifier, {least} to {most} Hz",
        least = RATES_HZ.start(),
        most = RATES_HZ.end()
    )]
    Rate(u16),
    /// The numbers of labels, channels, samples and values do not belong together.
    #[error(
        "eeg has {values} values and {labels} labels for {nsamples} samples of {nchannels} channels; \
         publish nsamples * nchannels values and one label per channel"
    )]
    Shape {
        /// Number of values in `eeg.data`.
        values: usize,
        /// Number of labels in `eeg.info`.
        labels: usize,
        /// Samples per channel that `eeg.info` announces.
        nsamples: u16,
        /// Number of channels that `eeg.info` announces.
        nchannels: u16,
    },
    /// The unit in `eeg.info` is not microvolt.
    #[error("the unit is \"{0}\"; publish microvolts with the unit uV")]
    Unit(String),
    /// A value is NaN or infinite.
    #[error("sample {sample} of {label} is {value}; publish numbers only")]
    NotFinite {
        /// Index of the sample in the frame.
        sample: usize,
        /// Label of the channel.
        label: String,
        /// The value.
        value: f32,
    },
    /// The labels do not fit the model's montage.
    #[error(transparent)]
    Labels(#[from] MontageMapError),
    /// The layout differs from that of the first frame.
    #[error(
        "{what} changed from {expected} to {found}; restart this node and the recorder to use the new \
         layout"
    )]
    Changed {
        /// Property that differs.
        what: &'static str,
        /// Value in the first frame.
        expected: String,
        /// Value in the refused frame.
        found: String,
    },
    /// The frame has the same number, `neuroheader.seq`, as the one before.
    #[error("frame {0} came twice; stop one of the nodes that publish the topic")]
    Repeated(u32),
    /// Several nodes publish the topic, and their frames cannot be distinguished. Holds the number
    /// of connected publishers.
    #[error("{0} nodes publish the topic and their frames are mixed; stop all but one")]
    Mixed(usize),
    /// The samples cannot be converted.
    #[error("the samples cannot be converted: {0}")]
    Conversion(#[from] RecordingError),
}

impl Refusal {
    /// Returns a name for `/diagnostics` and for logging each kind once.
    pub fn kind(&self) -> &'static str {
        match self {
            Refusal::Message(_) => "message",
            Refusal::Rate(_) => "rate",
            Refusal::Shape { .. } => "shape",
            Refusal::Unit(_) => "unit",
            Refusal::NotFinite { .. } => "not finite",
            Refusal::Labels(_) => "labels",
            Refusal::Changed { .. } => "changed layout",
            Refusal::Repeated(_) => "repeated",
            Refusal::Mixed(_) => "mixed",
            Refusal::Conversion(_) => "conversion",
        }
    }
}
