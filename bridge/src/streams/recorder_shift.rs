//! Time from the electrodes to a recorder, for each topic.

use crate::decoder::reconstruction::Reconstruction;
use crate::device::Device;
use crate::settings::AnnouncedStream;

impl Device {
    /// Returns the time from the first sample of a frame, at the electrodes, to the end of the
    /// acquisition and filtering of all data that the frame is made of, microseconds. The transfer to
    /// the host follows.
    pub(crate) fn frame_lookback_us(&self, stream: AnnouncedStream, low_latency: bool) -> i64 {
        let filters_us = i64::from(self.group_delay_us);
        let hop = u32::from(self.hop_steps);
        match stream {
            AnnouncedStream::Encoded => {
                self.steps_us(u32::from(self.window_steps) - 1) + filters_us
            }
            AnnouncedStream::Reconstructed => {
                let steps = Reconstruction::lookback_steps(self, low_latency);
                self.steps_us(steps) + filters_us
            }
            AnnouncedStream::Raw => {
                let info = self.raw_frame().eeg.info;
                (i64::from(info.nsamples) - 1) * 1_000_000 / i64::from(self.adc_rate_hz)
            }
            AnnouncedStream::Filtered => self.steps_us(hop - 1) + filters_us,
        }
    }

    /// Returns the time that a recorder of this stream adds to the time of an event, microseconds.
    ///
    /// `rosneuro_recorder` takes for the time of its first sample the arrival of the first frame minus
    /// the duration of the frame, and places an event by its stamp relative to that time. An event
    /// whose stamp is later than its true time by this shift is placed at the sample that was at the
    /// electrodes when it happened.
    pub(crate) fn recorder_shift_us(&self, stream: AnnouncedStream, low_latency: bool) -> i64 {
        let frame_us = match stream {
            AnnouncedStream::Encoded
            | AnnouncedStream::Reconstructed
            | AnnouncedStream::Filtered => self.steps_us(u32::from(self.hop_steps)),
            AnnouncedStream::Raw => {
                let info = self.raw_frame().eeg.info;
                i64::from(info.nsamples) * 1_000_000 / i64::from(self.adc_rate_hz)
            }
        };
        self.frame_lookback_us(stream, low_latency) - frame_us
    }
}
