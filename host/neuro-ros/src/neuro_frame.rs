//! `NeuroFrame` and its blocks of samples.

use serde::Serialize;

use crate::header::{Header, NeuroHeader};
use crate::status_words::tri_info;
use crate::wire::impl_wire;

/// `rosneuro_msgs/NeuroFrame`: the samples of all channels over a fixed number of time steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroFrame {
    /// ROS header; its `stamp` is the time of the first sample.
    pub header: Header,
    /// ROS-Neuro header; its `seq` is the sequence number of the frame.
    pub neuroheader: NeuroHeader,
    /// Sampling rate of every channel, Hz. Consumers compute the frame rate by the integer division
    /// `sr / nsamples`.
    pub sr: u16,
    /// Samples of the EEG channels; in encoded frames, the numbers of a code.
    pub eeg: NeuroDataFloat,
    /// Samples of bipolar channels; empty in this project.
    pub exg: NeuroDataFloat,
    /// Triggers and status words. Values have at most 16 bits. The recorder stores them as float32,
    /// which is exact up to 2^24.
    pub tri: NeuroDataInt32,
}

impl NeuroFrame {
    /// Value of `header.frame_id`, and start of `transducter`, in frames with values that the network
    /// computed.
    pub const NETWORK: &'static str = "autoencoder";

    /// Creates a frame for `/encoded` that holds one code of `numbers` values, all zeros.
    /// `eeg` has the transducter, the filters, and the smallest and largest value.
    pub fn encoded(codes_per_second: u16, numbers: usize, eeg: NeuroDataInfo) -> NeuroFrame {
        let eeg = NeuroDataInfo {
            nsamples: 1,
            unit: "a.u.".to_owned(),
            ..eeg.with_labels((0..numbers).map(|index| format!("z{index:03}")).collect())
        };
        let exg = NeuroDataInfo::default();
        NeuroFrame::zeros(codes_per_second, NeuroFrame::NETWORK, eeg, exg)
    }

    /// Creates a frame in which every value is 0, with the `tri` channels of the status words.
    pub fn zeros(
        sr: u16,
        frame_id: &str,
        eeg: NeuroDataInfo,
        mut exg: NeuroDataInfo,
    ) -> NeuroFrame {
        let nsamples = eeg.nsamples;
        let values = |channels: u16| usize::from(nsamples) * usize::from(channels);
        exg.nsamples = nsamples;
        if exg.minmax.is_empty() {
            exg.minmax = vec![0.0, 0.0];
        }
        let tri = tri_info(nsamples);
        let mut frame = NeuroFrame {
            sr,
            ..NeuroFrame::default()
        };
        frame_id.clone_into(&mut frame.header.frame_id);
        frame.eeg = NeuroDataFloat {
            data: vec![0.0; values(eeg.nchannels)],
            info: eeg,
        };
        frame.exg = NeuroDataFloat {
            data: vec![0.0; values(exg.nchannels)],
            info: exg,
        };
        frame.tri = NeuroDataInt32 {
            data: vec![0; values(tri.nchannels)],
            info: tri,
        };
        frame
    }
}

impl_wire!(NeuroFrame {
    header: Header,
    neuroheader: NeuroHeader,
    sr: u16,
    eeg: NeuroDataFloat,
    exg: NeuroDataFloat,
    tri: NeuroDataInt32,
});

/// `rosneuro_msgs/NeuroDataInfo`: shape and meaning of a block of samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataInfo {
    /// Samples per channel in one frame.
    pub nsamples: u16,
    /// Number of channels, one label each.
    pub nchannels: u16,
    /// Bytes per time step over all channels, `nchannels * 4`.
    pub stride: u16,
    /// Physical unit, such as `uV`.
    pub unit: String,
    /// Transducer, such as the type of electrode. The field's name is misspelled in the message
    /// definition.
    pub transducter: String,
    /// Description of the filters that were applied.
    pub prefiltering: String,
    /// 1 for integer samples, 0 for float.
    pub isint: u8,
    /// Smallest and largest possible sample value. The recorder's GDF file stores a value outside
    /// this range as infinity.
    pub minmax: Vec<f64>,
    /// Names of the channels, in the order of the channels in `data`.
    pub labels: Vec<String>,
}

impl NeuroDataInfo {
    /// Returns the description with these channels.
    #[must_use]
    pub fn with_labels(self, labels: Vec<String>) -> NeuroDataInfo {
        let nchannels = u16::try_from(labels.len()).unwrap_or(u16::MAX);
        NeuroDataInfo {
            nchannels,
            stride: nchannels.saturating_mul(4),
            labels,
            ..self
        }
    }
}

impl_wire!(NeuroDataInfo {
    nsamples: u16,
    nchannels: u16,
    stride: u16,
    unit: String,
    transducter: String,
    prefiltering: String,
    isint: u8,
    minmax: Vec<f64>,
    labels: Vec<String>,
});

/// `rosneuro_msgs/NeuroDataFloat`: a block of float32 samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataFloat {
    /// Shape, unit and channel labels of `data`.
    pub info: NeuroDataInfo,
    /// Samples in `info.unit`, sample-major: `data[sample * nchannels + channel]`.
    pub data: Vec<f32>,
}

impl_wire!(NeuroDataFloat { info: NeuroDataInfo, data: Vec<f32> });

/// `rosneuro_msgs/NeuroDataInt32`: a block of int32 samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataInt32 {
    /// Shape, unit and channel labels of `data`.
    pub info: NeuroDataInfo,
    /// Samples, sample-major: `data[sample * nchannels + channel]`.
    pub data: Vec<i32>,
}

impl_wire!(NeuroDataInt32 { info: NeuroDataInfo, data: Vec<i32> });
