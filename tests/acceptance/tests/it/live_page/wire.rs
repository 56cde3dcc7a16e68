//! The samples of one topic, read from the JSON lines that a bridge has printed.

use acceptance::printing::messages;
use serde_json::Value;

/// Flag of a sample that replaces a lost one.
const FILLER: u64 = 0x8000;
/// Number of steps from the first step of a reconstructed frame to the last step of the 16-step
/// window from which it was decoded. In the JSON lines, all steps of a frame have the device time
/// of this last step; the page shows each step's own device time.
const LOOKBACK_STEPS: u64 = 15;

pub(super) struct Sample {
    /// Device time, microseconds.
    pub(super) us: u64,
    pub(super) is_filler: bool,
    pub(super) trigger: u64,
    pub(super) values: Vec<f64>,
}

/// The samples of one topic, in the order of the JSON lines.
pub(super) struct Wire {
    pub(super) labels: Vec<String>,
    /// Number of electrodes; their labels come first in `labels`.
    pub(super) electrodes: usize,
    pub(super) samples: Vec<Sample>,
}

impl Wire {
    pub(super) fn read(lines: &str, topic: &str) -> Wire {
        let mut wire = Wire { labels: Vec::new(), electrodes: 0, samples: Vec::new() };
        for frame in messages(lines, topic) {
            let blocks = ["eeg", "exg"].map(|name| &frame[name]);
            if wire.labels.is_empty() {
                let labels = blocks.map(|block| texts(&block["info"]["labels"]));
                wire.electrodes = labels[0].len();
                wire.labels = labels.concat();
            }
            let data = blocks.map(|block| numbers(&block["data"]));
            let tri = numbers(&frame["tri"]["data"]);
            for (step, words) in tri.chunks(8).enumerate() {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "words of 16 bits"
                )]
                let word = |index: usize| words[index] as u64;
                let mut us = word(3) | word(4) << 16 | word(5) << 32;
                if topic == "/neurodata_reconstructed" {
                    us -= (LOOKBACK_STEPS - step as u64) * 1_000_000 / 128;
                }
                let rows = data.iter().map(|data| {
                    let width = data.len() / (tri.len() / 8);
                    &data[step * width..(step + 1) * width]
                });
                wire.samples.push(Sample {
                    us,
                    is_filler: word(0) & FILLER != 0,
                    trigger: word(7),
                    values: rows.flatten().copied().collect(),
                });
            }
        }
        wire
    }

    /// Returns the device time of the newest sample, microseconds.
    pub(super) fn newest(&self) -> u64 {
        self.samples.last().expect("samples").us
    }

    pub(super) fn channel(&self, label: &str) -> usize {
        let mut labels = self.labels.iter();
        labels.position(|one| one == label).unwrap_or_else(|| panic!("{label} is no label"))
    }

    /// Returns the index of the sample at a device time.
    pub(super) fn at(&self, us: u64) -> usize {
        let index = self.samples.iter().position(|sample| sample.us == us);
        index.unwrap_or_else(|| panic!("no sample at {us} us"))
    }

    /// Returns the index of the sample nearest to a device time.
    pub(super) fn near(&self, us: u64) -> usize {
        let samples = self.samples.iter().enumerate();
        let nearest = samples.min_by_key(|(_, sample)| sample.us.abs_diff(us));
        nearest.expect("samples").0
    }

    /// Returns a channel's value as the float32 that the bridge printed in decimal. The printed
    /// digits differ from the float32 by up to 1 nV at an offset of 20 mV, which would be visible
    /// in a spectrum.
    pub(super) fn float32(&self, index: usize, channel: usize) -> f64 {
        #[expect(clippy::cast_possible_truncation, reason = "printed from a float32")]
        let value = self.samples[index].values[channel] as f32;
        value.into()
    }

    /// Returns the value of an electrode minus the mean of all electrodes but Cz.
    pub(super) fn to_average(&self, index: usize, label: &str) -> f64 {
        let part = (0..self.electrodes).filter(|channel| self.labels[*channel] != "Cz");
        let part: Vec<f64> = part.map(|channel| self.float32(index, channel)).collect();
        #[expect(clippy::cast_precision_loss, reason = "60 electrodes")]
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        self.float32(index, self.channel(label)) - mean
    }
}

fn texts(list: &Value) -> Vec<String> {
    let list = list.as_array().into_iter().flatten();
    list.filter_map(|text| text.as_str().map(str::to_owned)).collect()
}

fn numbers(list: &Value) -> Vec<f64> {
    let list = list.as_array().into_iter().flatten();
    list.filter_map(Value::as_f64).collect()
}
