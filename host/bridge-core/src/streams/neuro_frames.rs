//! NeuroFrames of each stream, with their status words.

use neuro_ros::{NeuroDataFloat, NeuroDataInfo, NeuroDataInt32, NeuroFrame};

use crate::device::Device;

/// Value of `header.frame_id`, and start of `transducter`, in frames with values that the network
/// computed.
const NETWORK: &str = "autoencoder";
/// Value of `header.frame_id`, and start of `transducter`, in frames with values that the packed
/// code holds.
const PACKED: &str = "packed code";
/// Value of `header.frame_id`, and start of `transducter`, in frames with voltages that the
/// amplifier measured.
const AMPLIFIER: &str = "electrodes";

impl Device {
    /// Returns a frame for `/encoded` that holds one code, all zeros.
    pub fn encoded_frame(&self) -> NeuroFrame {
        let numbers = u16::try_from(self.numbers()).unwrap_or(u16::MAX);
        let labels = (0..numbers).map(|index| format!("z{index:03}")).collect();
        let eeg = NeuroDataInfo {
            nsamples: 1,
            nchannels: numbers,
            // Bytes of one sample, with four bytes for each number.
            stride: numbers.saturating_mul(4),
            unit: "a.u.".to_owned(),
            transducter: self.transducter(NETWORK),
            prefiltering: self.filters.clone(),
            isint: 0,
            minmax: self.code_range.map(f64::from).to_vec(),
            labels,
        };
        frame(
            self.codes_per_second(),
            NETWORK,
            eeg,
            NeuroDataInfo::default(),
        )
    }

    /// Returns a frame for `/neurodata_reconstructed`, from codes, that holds the steps of one hop,
    /// all zeros.
    pub fn reconstructed_frame(&self) -> NeuroFrame {
        self.hop_frame(NETWORK)
    }

    /// Returns a frame for `/neurodata_reconstructed`, from packed blocks, that holds the steps of
    /// one hop, all zeros.
    pub fn unpacked_frame(&self) -> NeuroFrame {
        self.hop_frame(PACKED)
    }

    fn hop_frame(&self, origin: &str) -> NeuroFrame {
        let eeg = NeuroDataInfo {
            transducter: self.transducter(origin),
            ..self.electrodes(u16::from(self.hop_steps))
        };
        frame(self.step_rate_hz, origin, eeg, NeuroDataInfo::default())
    }

    /// Returns a frame for `/neurodata_corticode` that holds the steps of one hop, all zeros.
    pub fn filtered_frame(&self) -> NeuroFrame {
        let eeg = self.electrodes(u16::from(self.hop_steps));
        frame(self.step_rate_hz, AMPLIFIER, eeg, NeuroDataInfo::default())
    }

    /// Returns a frame for `/neurodata` that holds the samples of about one hop, all zeros, with
    /// the spare channels in `exg`.
    pub fn raw_frame(&self) -> NeuroFrame {
        let eeg = NeuroDataInfo {
            prefiltering: "none".to_owned(),
            ..self.electrodes(self.raw_samples())
        };
        let electrodes = self.labels.len();
        let spare = electrodes..usize::from(self.channels).max(electrodes);
        let labels = spare.map(|channel| self.channel_label(channel)).collect();
        let exg = NeuroDataInfo {
            transducter: AMPLIFIER.to_owned(),
            ..channels_like(&eeg, labels)
        };
        frame(self.adc_rate_hz, AMPLIFIER, eeg, exg)
    }

    /// Returns the number of samples in a frame of `/neurodata`: the largest divisor of the ADC's
    /// rate that does not exceed the number of samples per hop. It must be a divisor because
    /// consumers compute the frame rate in integers.
    fn raw_samples(&self) -> u16 {
        let hop = u32::from(self.adc_rate_hz) * u32::from(self.hop_steps);
        let most = u16::try_from(hop / u32::from(self.step_rate_hz)).unwrap_or(u16::MAX);
        let divides = |samples: &u16| self.adc_rate_hz.is_multiple_of(*samples);
        (1..=most).rev().find(divides).unwrap_or(1)
    }

    /// Returns `origin`, followed by the electrodes whose signal was not recorded.
    fn transducter(&self, origin: &str) -> String {
        match self.unrecorded() {
            Some(unrecorded) => format!("{origin}; {unrecorded}"),
            None => origin.to_owned(),
        }
    }

    fn electrodes(&self, nsamples: u16) -> NeuroDataInfo {
        let info = NeuroDataInfo {
            nsamples,
            unit: "uV".to_owned(),
            transducter: self.transducter(AMPLIFIER),
            prefiltering: self.filters.clone(),
            minmax: vec![-self.full_scale_uv, self.full_scale_uv],
            ..NeuroDataInfo::default()
        };
        channels_like(&info, self.labels.clone())
    }
}

/// Returns a copy of `info` for the channels `labels`.
fn channels_like(info: &NeuroDataInfo, labels: Vec<String>) -> NeuroDataInfo {
    let nchannels = u16::try_from(labels.len()).unwrap_or(u16::MAX);
    NeuroDataInfo {
        nchannels,
        stride: nchannels.saturating_mul(4),
        labels,
        ..info.clone()
    }
}

fn frame(sr: u16, frame_id: &str, eeg: NeuroDataInfo, mut exg: NeuroDataInfo) -> NeuroFrame {
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

/// Labels of the eight `tri` channels, in the order of [`TriWords::words`].
pub const TRI_LABELS: [&str; 8] = [
    "flags", "seq_lo", "seq_hi", "t_us_0", "t_us_1", "t_us_2", "lost", "trigger",
];

/// Status of one code, packed block, sample or step, published as eight `tri` words.
///
/// Every word has 16 bits (0 to 65535), because the recorder stores `tri` as float32, which is
/// exact only for integers up to 2^24.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TriWords {
    /// Bits of [`link::Flags`], including `filler`.
    pub flags: u16,
    /// Index, since `Start`, of the code's window or of the packed block, or of the frame that
    /// contains the sample or step.
    pub window: u32,
    /// Device time of the last step of the window or block, or of the sample or step itself,
    /// microseconds. The words carry the low 48 bits, which wrap after 8.9 years.
    pub device_time_us: u64,
    /// Number of codes, blocks, samples or steps of this stream that were lost since the bridge
    /// started. The word carries the number modulo 2^16.
    pub lost: u64,
    /// Level of the trigger input, 0 or 1, according to the edges received; 0 before the first
    /// edge, and always 0 without the stream of events.
    pub trigger: u16,
}

impl TriWords {
    /// Returns the words in the order of [`TRI_LABELS`].
    pub fn words(&self) -> [i32; 8] {
        let [t0, t1, t2, _] = sixteen_bits(self.device_time_us);
        let [lost, ..] = sixteen_bits(self.lost);
        let [seq_lo, seq_hi, ..] = sixteen_bits(u64::from(self.window));
        [self.flags, seq_lo, seq_hi, t0, t1, t2, lost, self.trigger].map(i32::from)
    }
}

fn sixteen_bits(value: u64) -> [u16; 4] {
    let bytes = value.to_le_bytes();
    std::array::from_fn(|word| u16::from_le_bytes([bytes[2 * word], bytes[2 * word + 1]]))
}

/// Range that is announced for the status words.
///
/// ROS-Neuro's recorder stores `tri` in GDF as float32 and maps this range to the whole range of
/// float32. The range of the words themselves, 0 to 65535, makes almost every stored word infinite
/// or inexact; with 24 bits and sign, words come back as they were.
const RANGE: [f64; 2] = [-8_388_608.0, 8_388_607.0];

/// Returns the description of a `tri` block that holds the words of `nsamples` samples.
pub(crate) fn tri_info(nsamples: u16) -> NeuroDataInfo {
    NeuroDataInfo {
        nsamples,
        nchannels: 8,
        stride: 32,
        unit: "bits".to_owned(),
        transducter: "corticode status words".to_owned(),
        prefiltering: String::new(),
        isint: 1,
        minmax: RANGE.to_vec(),
        labels: TRI_LABELS.map(str::to_owned).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::{TRI_LABELS, TriWords};

    #[test]
    fn values_are_split_into_words_low_word_first() {
        let words = TriWords {
            flags: 0x8011,
            window: 0xDEAD_BEEF,
            device_time_us: 0x1234_5678_9ABC,
            lost: 0x0001_0002,
            trigger: 3,
        };
        assert_eq!(
            words.words(),
            [0x8011, 0xBEEF, 0xDEAD, 0x9ABC, 0x5678, 0x1234, 0x0002, 3],
            "{TRI_LABELS:?}"
        );
    }
}
