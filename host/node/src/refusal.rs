//! Reasons for not encoding a frame of the acquisition.

use recordings::{MontageMapError, RecordingError};
use thiserror::Error;

use crate::layout::LEAST_RATE_HZ;

/// Why a frame of the acquisition is not encoded. The frame then counts as lost.
#[derive(Debug, Error)]
pub enum Refusal {
    /// The message is not a `NeuroFrame`.
    #[error("a message is no NeuroFrame ({0}); publish rosneuro_msgs/NeuroFrame")]
    Message(#[from] neuro_ros::WireError),
    /// The sampling rate is too low. Holds the rate in Hz.
    #[error(
        "the rate is {0} Hz; set sr to the sampling rate of the amplifier, at least {LEAST_RATE_HZ} Hz"
    )]
    Rate(u16),
    /// The numbers of labels, channels, samples and values contradict each other.
    #[error(
        "eeg has {values} values and {labels} labels for {nsamples} samples of {nchannels} channels; \
         publish nsamples * nchannels values and one label per channel"
    )]
    Shape {
        /// Number of values in `eeg.data`.
        values: usize,
        /// Number of labels in `eeg.info.labels`.
        labels: usize,
        /// Number of samples per channel, as `eeg.info` states it.
        nsamples: u16,
        /// Number of channels, as `eeg.info` states it.
        nchannels: u16,
    },
    /// The unit in `eeg.info` is not microvolts. Holds the unit.
    #[error("the unit is \"{0}\"; publish microvolts with the unit uV")]
    Unit(String),
    /// A value is NaN or infinite.
    #[error("sample {sample} of {label} is {value}; publish numbers only")]
    NotFinite {
        /// Index of the sample within the frame.
        sample: usize,
        /// Label of the value's channel.
        label: String,
        /// The value that is NaN or infinite.
        value: f32,
    },
    /// The labels of the channels do not fit the model's montage.
    #[error(transparent)]
    Labels(#[from] MontageMapError),
    /// The layout differs from the layout of the first frame.
    #[error(
        "{what} changed from {expected} to {found}; restart this node and the recorder to use the new \
         layout"
    )]
    Changed {
        /// Property of the layout that differs, such as the rate.
        what: &'static str,
        /// Value of the property in the first frame.
        expected: String,
        /// Value of the property in the refused frame.
        found: String,
    },
    /// The frame has the same number, `neuroheader.seq`, as the frame before it. Holds the number.
    #[error("frame {0} came twice; stop one of the nodes that publish the topic")]
    Repeated(u32),
    /// Several nodes publish the topic, and frames do not say which node they come from. Holds the
    /// number of these nodes.
    #[error("{0} nodes publish the topic and their frames are mixed; stop all but one")]
    Mixed(usize),
    /// The stream of the Lab Streaming Layer cannot be used.
    #[error(transparent)]
    Stream(#[from] lsl::InletError),
    /// The virtual ADC cannot convert the samples.
    #[error("the samples cannot be converted: {0}")]
    Conversion(#[from] RecordingError),
}

impl Refusal {
    /// Returns the name of this kind of refusal. The log shows only the first refusal of each kind.
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
            Refusal::Stream(error) => error.kind(),
            Refusal::Conversion(_) => "conversion",
        }
    }
}
