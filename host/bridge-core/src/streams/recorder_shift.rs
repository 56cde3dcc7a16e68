//! Time from the electrodes to a recorder, for each topic.

use crate::decoder::reconstruction::Reconstruction;
use crate::device::Device;
use crate::settings::{AnnouncedStream, Settings};
use crate::streams::decoding::DecodedStream;

impl Device {
    /// Returns the time from the first sample of a frame, at the electrodes, to the end of the
    /// acquisition and filtering of all data that the frame is made of, microseconds. The transfer to
    /// the host follows. `decoded` is the stream that `/neurodata_reconstructed` is decoded from.
    pub(crate) fn frame_lookback_us(
        &self,
        stream: AnnouncedStream,
        decoded: DecodedStream,
        settings: &Settings,
    ) -> i64 {
        let filters_us = i64::from(self.group_delay_us);
        match stream {
            AnnouncedStream::Encoded => {
                self.steps_us(u32::from(self.window_steps) - 1) + filters_us
            }
            AnnouncedStream::Reconstructed => {
                let hop = u32::from(self.hop_steps);
                let steps = match (decoded, settings.low_latency) {
                    (DecodedStream::Codes, low_latency) => {
                        Reconstruction::lookback_steps(self, low_latency)
                    }
                    (DecodedStream::Packed, true) => hop - 1,
                    // The block after the frame's own completes it.
                    (DecodedStream::Packed, false) => 2 * hop - 1,
                };
                self.steps_us(steps) + filters_us
            }
            AnnouncedStream::Raw => {
                let (samples, rate_hz) = self.frame_length(stream);
                (i64::from(samples) - 1) * 1_000_000 / i64::from(rate_hz)
            }
            AnnouncedStream::Filtered => self.steps_us(u32::from(self.hop_steps) - 1) + filters_us,
        }
    }

    /// Returns the time by which the stamp of an event must be later than the event, microseconds, to be
    /// read from a recording of this stream at the sample that was at the electrodes when it happened.
    ///
    /// `rosneuro_recorder` takes for the time of its first sample the arrival of the first frame minus
    /// the frame's duration, and places an event by its stamp relative to that time. Its library,
    /// libxdffileio, rounds the place down and counts from 0, where GDF and its readers count from 1.
    /// Half a sample makes the rounding exact, and a whole sample the counting.
    pub(crate) fn recorder_shift_us(
        &self,
        stream: AnnouncedStream,
        decoded: DecodedStream,
        settings: &Settings,
    ) -> i64 {
        let (samples, rate_hz) = self.frame_length(stream);
        let halves_us = |halves: i64| halves * 500_000 / i64::from(rate_hz);
        self.frame_lookback_us(stream, decoded, settings) + halves_us(3 - 2 * i64::from(samples))
    }

    /// Returns the number of samples in a frame of this stream, and their rate in Hz.
    fn frame_length(&self, stream: AnnouncedStream) -> (u16, u16) {
        let frame = match stream {
            AnnouncedStream::Encoded => return (1, self.codes_per_second()),
            AnnouncedStream::Reconstructed => self.reconstructed_frame(),
            AnnouncedStream::Raw => self.raw_frame(),
            AnnouncedStream::Filtered => self.filtered_frame(),
        };
        (frame.eeg.info.nsamples, frame.sr)
    }
}
