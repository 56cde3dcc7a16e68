//! Blocks of samples and what they mean.

use serde::Serialize;

use crate::wire::fields;

/// `rosneuro_msgs/NeuroDataInfo`: shape and meaning of a block.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataInfo {
    /// Samples per channel in one frame.
    pub nsamples: u16,
    /// Channels.
    pub nchannels: u16,
    /// Bytes of one sample of all channels: `nchannels * 4`.
    pub stride: u16,
    /// Physical unit, such as `uV`.
    pub unit: String,
    /// What made the signal; the message spells it so.
    pub transducter: String,
    /// Filters that were applied, in words.
    pub prefiltering: String,
    /// 1 if the data are integers.
    pub isint: u8,
    /// Exactly two: the smallest and the largest value there can be. A value outside reads back
    /// as infinite from the recorder's GDF.
    pub minmax: Vec<f64>,
    /// One per channel.
    pub labels: Vec<String>,
}

fields!(NeuroDataInfo {
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

/// `rosneuro_msgs/NeuroDataFloat`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataFloat {
    /// Shape and meaning.
    pub info: NeuroDataInfo,
    /// In `info.unit`, samples-major: `data[sample * nchannels + channel]`.
    pub data: Vec<f32>,
}

fields!(NeuroDataFloat { info: NeuroDataInfo, data: Vec<f32> });

/// `rosneuro_msgs/NeuroDataInt32`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataInt32 {
    /// Shape and meaning.
    pub info: NeuroDataInfo,
    /// Samples-major: `data[sample * nchannels + channel]`.
    pub data: Vec<i32>,
}

fields!(NeuroDataInt32 { info: NeuroDataInfo, data: Vec<i32> });
