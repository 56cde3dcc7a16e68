//! One frame of a running acquisition.

use serde::Serialize;

use crate::wire::fields;
use crate::{Header, NeuroDataFloat, NeuroDataInt32, NeuroHeader};

/// `rosneuro_msgs/NeuroFrame`: one frame of a running acquisition.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroFrame {
    /// `header.stamp`: time of the first sample.
    pub header: Header,
    /// The frame's number.
    pub neuroheader: NeuroHeader,
    /// Samples per second inside the frame; frames per second are `sr / nsamples`, in integers.
    pub sr: u16,
    /// The signal.
    pub eeg: NeuroDataFloat,
    /// Bipolar channels; none here.
    pub exg: NeuroDataFloat,
    /// Triggers and status words; the recorder stores them as float32, so each stays within 16 bits.
    pub tri: NeuroDataInt32,
}

fields!(NeuroFrame {
    header: Header,
    neuroheader: NeuroHeader,
    sr: u16,
    eeg: NeuroDataFloat,
    exg: NeuroDataFloat,
    tri: NeuroDataInt32,
});
