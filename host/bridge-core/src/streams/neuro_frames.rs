//! Templates of the NeuroFrames for the topics of a device.

use neuro_ros::{NeuroDataInfo, NeuroFrame};

use crate::device::{Device, channel_label};

/// In frames of signals decoded from packed blocks: value of `header.frame_id`, and start of
/// `transducter`.
const PACKED: &str = "packed code";
/// In frames of voltages that the amplifier measured: value of `header.frame_id`, and start of
/// `transducter`.
const AMPLIFIER: &str = "electrodes";

impl Device {
    /// Returns a frame for `/encoded`, with room for one code; all values are zero.
    pub fn encoded_frame(&self) -> NeuroFrame {
        let eeg = NeuroDataInfo {
            transducter: self.transducter(NeuroFrame::NETWORK),
            prefiltering: self.filters.clone(),
            minmax: self.code_range.map(f64::from).to_vec(),
            ..NeuroDataInfo::default()
        };
        NeuroFrame::encoded(self.codes_per_second(), self.numbers(), eeg)
    }

    /// Returns a frame for signals decoded from codes, for `/neurodata_reconstructed`. It has room
    /// for the steps of one hop; all values are zero.
    pub fn reconstructed_frame(&self) -> NeuroFrame {
        self.hop_frame(NeuroFrame::NETWORK)
    }

    /// Returns a frame for signals decoded from packed blocks, for `/neurodata_reconstructed`. It
    /// has room for the steps of one hop; all values are zero.
    pub fn unpacked_frame(&self) -> NeuroFrame {
        self.hop_frame(PACKED)
    }

    fn hop_frame(&self, origin: &str) -> NeuroFrame {
        let eeg = NeuroDataInfo {
            transducter: self.transducter(origin),
            ..self.electrodes(u16::from(self.hop_steps))
        };
        NeuroFrame::zeros(self.step_rate_hz, origin, eeg, NeuroDataInfo::default())
    }

    /// Returns a frame for `/neurodata_corticode`, with room for a hop of steps; all values are 0.
    pub fn filtered_frame(&self) -> NeuroFrame {
        let eeg = self.electrodes(u16::from(self.hop_steps));
        NeuroFrame::zeros(self.step_rate_hz, AMPLIFIER, eeg, NeuroDataInfo::default())
    }

    /// Returns a frame for `/neurodata`, with room for the samples of about one hop; all values are
    /// zero. The spare channels are in `exg`.
    pub fn raw_frame(&self) -> NeuroFrame {
        let eeg = NeuroDataInfo {
            prefiltering: "none".to_owned(),
            ..self.electrodes(self.raw_samples())
        };
        let electrodes = self.labels.len();
        let spare = electrodes..usize::from(self.channels).max(electrodes);
        let labels = spare.map(|channel| channel_label(&self.labels, channel));
        let exg = NeuroDataInfo {
            transducter: AMPLIFIER.to_owned(),
            ..eeg.clone().with_labels(labels.collect())
        };
        NeuroFrame::zeros(self.adc_rate_hz, AMPLIFIER, eeg, exg)
    }

    /// Returns the number of samples in a frame of `/neurodata`: the largest divisor of the ADC's
    /// rate that is not larger than the number of samples per hop. Consumers compute the frame rate
    /// by an integer division, which must be exact.
    fn raw_samples(&self) -> u16 {
        let hop = u32::from(self.adc_rate_hz) * u32::from(self.hop_steps);
        let most = u16::try_from(hop / u32::from(self.step_rate_hz)).unwrap_or(u16::MAX);
        let divides = |samples: &u16| self.adc_rate_hz.is_multiple_of(*samples);
        (1..=most).rev().find(divides).unwrap_or(1)
    }

    /// Returns `origin`, followed by the electrodes without a recorded signal, if there are any.
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
        info.with_labels(self.labels.clone())
    }
}
