//! Status words in the `tri` block of every NeuroFrame.

use crate::rosneuro_msgs::NeuroDataInfo;

/// Labels of the eight `tri` channels, in the order of [`TriWords::words`].
pub const TRI_LABELS: [&str; 8] =
    ["flags", "seq_lo", "seq_hi", "t_us_0", "t_us_1", "t_us_2", "lost", "trigger"];

/// Status of one code, packed block, sample or step, published as eight `tri` words.
///
/// Every word has 16 bits (0 to 65535), because the recorder stores `tri` as float32, which is
/// exact only for integers up to 2^24.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TriWords {
    /// Flags of the code or frame as on the wire, with the bits that the host adds, such as
    /// `filler`.
    pub flags: u16,
    /// Index, counted from `Start`, of the code's window, of the packed block, or of the frame that
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
/// ROS-Neuro's recorder stores `tri` in GDF as float32 and scales this range to the whole range of
/// float32. With the words' own range, 0 to 65535, that scaling overflows or rounds almost every
/// word. With the range of a signed 24-bit integer every word is restored exactly.
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
