//! The messages of ROS-Neuro, and the headers at their start.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::Serialize;

use crate::status_words::tri_info;
use crate::wire::impl_wire;

const SECOND_NS: u64 = 1_000_000_000;

/// ROS 1 `time`: seconds and nanoseconds since 1970-01-01 UTC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Stamp {
    /// Whole seconds since 1970-01-01 UTC; overflows in 2106.
    pub secs: u32,
    /// Nanoseconds within the second, 0..=999,999,999.
    pub nsecs: u32,
}

impl_wire!(Stamp { secs, nsecs });

impl Stamp {
    /// Converts nanoseconds since 1970-01-01 UTC. Times before 1970 or after 2106 are clamped to
    /// this range.
    pub fn from_nanoseconds(nanoseconds: i64) -> Stamp {
        let nanoseconds = u64::try_from(nanoseconds).unwrap_or(0);
        match u32::try_from(nanoseconds / SECOND_NS) {
            Ok(secs) => {
                let nsecs = (nanoseconds % SECOND_NS) as u32;
                Stamp { secs, nsecs }
            }
            Err(_) => Stamp { secs: u32::MAX, nsecs: 999_999_999 },
        }
    }

    /// Returns whether this is time 0, which in ROS means that the time is not known.
    pub fn is_unset(&self) -> bool {
        *self == Stamp::default()
    }

    /// Returns the current time of the host's wall clock.
    pub fn now() -> Stamp {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
        Stamp::from_nanoseconds(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
    }

    /// Converts to nanoseconds since 1970-01-01 UTC, 0..=4.3e18.
    pub fn nanoseconds(self) -> i64 {
        // At most 4,294,967,295.999,999,999 s = 4.3e18 ns, below 2^63 = 9.2e18.
        i64::from(self.secs) * 1_000_000_000 + i64::from(self.nsecs)
    }
}

/// `std_msgs/Header`: sequence number, time and coordinate frame of a message.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Header {
    /// Sequence number of the message. In roscpp and rospy the publisher sets this number; in this
    /// crate the caller sets it to the value of [`NeuroHeader::seq`].
    pub seq: u32,
    /// Time of a frame's first sample, or start of an event. An unset stamp is left out of JSON.
    #[serde(skip_serializing_if = "Stamp::is_unset")]
    pub stamp: Stamp,
    /// Coordinate frame of the data, as free text; can be empty.
    pub frame_id: String,
}

impl_wire!(Header { seq, stamp, frame_id });

/// `rosneuro_msgs/NeuroHeader`: the sequence number of a frame or event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NeuroHeader {
    /// Sequence number: starts at 1, increases by one per message, wraps at 2^32.
    pub seq: u32,
}

impl_wire!(NeuroHeader { seq });

/// `rosneuro_msgs/NeuroEvent`: an event such as a trigger edge.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroEvent {
    /// ROS header; its `stamp` is the start of the event.
    pub header: Header,
    /// ROS-Neuro header; its `seq` is the sequence number of the event.
    pub neuroheader: NeuroHeader,
    /// Version of the event code table, as free text.
    pub version: String,
    /// Event code as in a GDF event table. Bit 15 (0x8000) marks the end of the event.
    pub event: i32,
    /// Duration of the event, s; 0 if unknown.
    pub duration: f32,
    /// Group of event codes that `event` belongs to.
    pub family: i32,
    /// Description of the event for display.
    pub description: String,
}

impl NeuroEvent {
    /// Event code of a rising edge of the trigger input. A falling edge has this code with
    /// [`Self::END`].
    pub const TRIGGER: i32 = 0x0001;
    /// Bit of [`NeuroEvent::event`] that marks the end of an event, which ROS-Neuro calls OFF.
    pub const END: i32 = 0x8000;

    /// Event code of a marker; the description of the event is the text that the user has typed.
    /// The code is above 255, because the codes 1 to 255 belong to the experiment.
    pub const MARKER: i32 = 0x7f05;

    /// Returns an event of the trigger input, still without sequence number, time and event code.
    pub fn on_bus() -> NeuroEvent {
        let mut event = NeuroEvent { version: "1".to_owned(), ..NeuroEvent::default() };
        "trigger".clone_into(&mut event.header.frame_id);
        event
    }

    /// Returns the event code and the description of an edge of the trigger input.
    pub const fn trigger_edge(is_rising: bool) -> (i32, &'static str) {
        if is_rising {
            (Self::TRIGGER, "trigger high")
        } else {
            (Self::TRIGGER | Self::END, "trigger low")
        }
    }
}

impl_wire!(NeuroEvent { header, neuroheader, version, event, duration, family, description });

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
    /// Samples of channels without an electrode; empty except in frames of ADC samples.
    pub exg: NeuroDataFloat,
    /// Triggers and status words. Values have at most 16 bits. The recorder stores them as float32,
    /// which is exact up to 2^24.
    pub tri: NeuroDataInt32,
}

impl NeuroFrame {
    /// Value of `header.frame_id`, and start of `transducter`, in frames whose values the network
    /// computed.
    pub const NETWORK: &'static str = "autoencoder";

    /// Creates a frame for `/encoded` that holds one code of `numbers` values, all zeros. Takes the
    /// transducer, the filters, and the smallest and largest value from `eeg`.
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
        let mut frame = NeuroFrame { sr, ..NeuroFrame::default() };
        frame_id.clone_into(&mut frame.header.frame_id);
        frame.eeg = NeuroDataFloat { data: vec![0.0; values(eeg.nchannels)], info: eeg };
        frame.exg = NeuroDataFloat { data: vec![0.0; values(exg.nchannels)], info: exg };
        frame.tri = NeuroDataInt32 { data: vec![0; values(tri.nchannels)], info: tri };
        frame
    }
}

impl_wire!(NeuroFrame { header, neuroheader, sr, eeg, exg, tri });

/// `rosneuro_msgs/NeuroOutput`: what a decoder predicts, one value for each class.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroOutput {
    /// ROS header. Its `stamp` refers to the same point of the hop as the stamp of a frame; its
    /// `frame_id` names the flags of the hop, such as `filler`, separated by blanks.
    pub header: Header,
    /// ROS-Neuro header; its `seq` is the sequence number of the prediction.
    pub neuroheader: NeuroHeader,
    /// Probability of each class, 0..=1; they sum to 1.
    pub softpredict: NeuroDataFloat,
    /// 1 for the class that was chosen, 0 for the others; all 0 if none was chosen, because the hop
    /// was lost, its signals were unusable, or the decision's window is not full yet.
    pub hardpredict: NeuroDataInt32,
    /// Decoder that made the prediction.
    pub decoder: NeuroDecoder,
}

impl_wire!(NeuroOutput { header, neuroheader, softpredict, hardpredict, decoder });

/// `rosneuro_msgs/NeuroDecoder`: the decoder that made a prediction.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NeuroDecoder {
    /// Kind of decoder, `corticode`.
    pub r#type: String,
    /// Id of the classifier's filters, eight hexadecimal digits.
    pub path: String,
    /// Event code of each class, in the order of the values of the prediction.
    pub classes: Vec<i32>,
}

impl_wire!(NeuroDecoder { r#type, path, classes });

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
    /// Returns this description with other channels, which have the names `labels`.
    #[must_use]
    pub fn with_labels(self, labels: Vec<String>) -> NeuroDataInfo {
        let nchannels = u16::try_from(labels.len()).unwrap_or(u16::MAX);
        NeuroDataInfo { nchannels, stride: nchannels.saturating_mul(4), labels, ..self }
    }
}

impl_wire!(NeuroDataInfo {
    nsamples,
    nchannels,
    stride,
    unit,
    transducter,
    prefiltering,
    isint,
    minmax,
    labels
});

/// `rosneuro_msgs/NeuroDataFloat`: a block of float32 samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataFloat {
    /// Shape, unit and channel labels of `data`.
    pub info: NeuroDataInfo,
    /// Samples in `info.unit`, sample-major: `data[sample * nchannels + channel]`.
    pub data: Vec<f32>,
}

impl_wire!(NeuroDataFloat { info, data });

/// `rosneuro_msgs/NeuroDataInt32`: a block of int32 samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroDataInt32 {
    /// Shape, unit and channel labels of `data`.
    pub info: NeuroDataInfo,
    /// Samples, sample-major: `data[sample * nchannels + channel]`.
    pub data: Vec<i32>,
}

impl_wire!(NeuroDataInt32 { info, data });
