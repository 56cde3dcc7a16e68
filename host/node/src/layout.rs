//! Layout of an acquisition's frames: rate, number of samples, and labels.

use std::fmt;

use neuro_ros::NeuroFrame;

use crate::refusal::Refusal;

/// Lowest supported sampling rate, Hz: the model's step rate. A lower rate lacks a part of the
/// model's frequency band.
pub(crate) const LEAST_RATE_HZ: u16 = model::STEP_RATE_HZ;

/// Units that mean microvolts, in lower case. Simple publishers leave the unit empty.
const UNITS: [&str; 5] = ["", "uv", "µv", "μv", "microvolt"];

/// Layout of an acquisition's frames, which must stay the same from frame to frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Sampling rate, Hz.
    pub rate_hz: u16,
    /// Number of samples per frame.
    pub samples: u16,
    /// Labels of the channels, in the order of the values within a sample.
    pub labels: Vec<String>,
}

impl Layout {
    /// Returns the layout of a frame.
    ///
    /// # Errors
    ///
    /// [`Refusal`] if the frame cannot be encoded.
    pub fn from_frame(frame: &NeuroFrame) -> Result<Layout, Refusal> {
        let info = &frame.eeg.info;
        if frame.sr < LEAST_RATE_HZ {
            return Err(Refusal::Rate(frame.sr));
        }
        let values = usize::from(info.nsamples) * usize::from(info.nchannels);
        let channels = usize::from(info.nchannels);
        if values == 0 || frame.eeg.data.len() != values || info.labels.len() != channels {
            return Err(Refusal::Shape {
                values: frame.eeg.data.len(),
                labels: info.labels.len(),
                nsamples: info.nsamples,
                nchannels: info.nchannels,
            });
        }
        if !UNITS.contains(&info.unit.trim().to_lowercase().as_str()) {
            return Err(Refusal::Unit(info.unit.clone()));
        }
        Ok(Layout { rate_hz: frame.sr, samples: info.nsamples, labels: info.labels.clone() })
    }

    /// Checks that a frame has this layout, and that no value in it is NaN or infinite.
    ///
    /// # Errors
    ///
    /// [`Refusal`] with the first difference.
    pub fn admit(&self, frame: &NeuroFrame) -> Result<(), Refusal> {
        let found = Layout::from_frame(frame)?;
        let changed = |what, expected: &dyn fmt::Display, found: &dyn fmt::Display| {
            let [expected, found] = [expected, found].map(ToString::to_string);
            Err(Refusal::Changed { what, expected, found })
        };
        if found.rate_hz != self.rate_hz {
            return changed("the rate in Hz", &self.rate_hz, &found.rate_hz);
        }
        if found.samples != self.samples {
            return changed("the samples per frame", &self.samples, &found.samples);
        }
        if found.labels.len() != self.labels.len() {
            let lengths = [self.labels.len(), found.labels.len()];
            return changed("the number of channels", &lengths[0], &lengths[1]);
        }
        let labels = self.labels.iter().zip(&found.labels);
        if let Some((old, new)) = labels.into_iter().find(|(old, new)| old != new) {
            return changed("a label", old, new);
        }
        let values = frame.eeg.data.iter();
        if let Some((index, value)) = values.enumerate().find(|(_, value)| !value.is_finite()) {
            return Err(Refusal::NotFinite {
                sample: index / self.labels.len(),
                label: self.labels[index % self.labels.len()].clone(),
                value: *value,
            });
        }
        Ok(())
    }

    /// Returns the duration of a frame, microseconds.
    pub fn frame_us(&self) -> i64 {
        i64::from(self.samples) * 1_000_000 / i64::from(self.rate_hz)
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} samples of {} electrodes at {} Hz",
            self.samples,
            self.labels.len(),
            self.rate_hz
        )
    }
}
