//! The status words beside every sample.

use neuro_ros::NeuroDataInfo;

/// Labels of the words, in order.
pub const TRI_LABELS: [&str; 8] = [
    "flags", "seq_lo", "seq_hi", "t_us_0", "t_us_1", "t_us_2", "lost", "trigger",
];

/// The status of one code. Every word is 16 bits, 0 to 65535, because the recorder stores `tri`
/// as float32, which holds integers exactly only up to 2^24.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TriWords {
    /// [`link::Flags`], `filler` included.
    pub flags: u16,
    /// Index of the code since the device's start of the stream.
    pub window: u32,
    /// Device time of the window's last sample, microseconds; the words hold its low 48 bits
    /// (8.9 years).
    pub device_time_us: u64,
    /// Codes lost since the bridge began, modulo 2^16; beside samples and steps, those of their own
    /// stream.
    pub lost: u64,
    /// Trigger input; 0 as long as the device sends no events.
    pub trigger: u16,
}

impl TriWords {
    /// The words in the order of [`TRI_LABELS`].
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

/// The block's description for frames of `nsamples` samples.
pub(crate) fn tri_info(nsamples: u16) -> NeuroDataInfo {
    NeuroDataInfo {
        nsamples,
        nchannels: 8,
        stride: 32,
        unit: "bits".to_owned(),
        transducter: "corticode status words".to_owned(),
        prefiltering: String::new(),
        isint: 1,
        minmax: vec![0.0, 65535.0],
        labels: TRI_LABELS.map(str::to_owned).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::{TRI_LABELS, TriWords};

    #[test]
    fn words_put_together_give_the_values_back() {
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
