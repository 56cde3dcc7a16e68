//! Stamps of published frames, and the time from a sample at the electrodes to the end of its
//! frame.

use link::Streams;
use neuro_ros::Stamp;

use crate::decoder::reconstruction::Reconstruction;
use crate::device::Device;
use crate::settings::{AnnouncedStream, Settings, StampPoint};
use crate::streams::event::Trigger;
use crate::time::HostTime;
use crate::time::clock::Clock;

/// What the conversion of a message needs besides its content: the times at which the device made
/// it and the host read it, the fitted clock that relates them, and the trigger input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reception<'a> {
    /// Device time in the message's header, microseconds; `None` if that time is impossible.
    pub(crate) device_us: Option<u64>,
    /// Host time at which the message was read.
    pub(crate) read: HostTime,
    pub(crate) clock: &'a Clock,
    pub(crate) trigger: &'a Trigger,
}

/// Where the steps of a frame lie, relative to the code or packed block that completes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameSteps {
    /// Number of steps from the frame's first step to the last step of the code or packed block
    /// that completes the frame.
    pub(crate) lookback: u32,
    /// Number of steps in the frame.
    pub(crate) length: u32,
}

/// Returns the time for a frame's stamp, nanoseconds since 1970. `device_us` is the device time of
/// the last step of the code or packed block that completes the frame.
pub(crate) fn frame_time_ns(
    device: &Device,
    point: StampPoint,
    device_us: i128,
    steps: FrameSteps,
    reception: Reception<'_>,
) -> i64 {
    let back_us = match point {
        StampPoint::First => device.steps_us(steps.lookback),
        StampPoint::Last => device.steps_us(steps.lookback + 1 - steps.length),
        StampPoint::Arrival => return reception.clock.wall_of_host_ns(reception.read),
    };
    let on_scalp = device_us - i128::from(back_us) - i128::from(device.group_delay_us);
    let wall_ns = reception.clock.wall_ns(on_scalp);
    wall_ns.unwrap_or(reception.read.wall_ns)
}

/// Makes stamps that increase: each is at least 1 us later than the one before, unless the wall
/// clock was set back by more than 30 s.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MonotoneStamps {
    last_ns: i64,
    /// Number of stamps that were moved forwards, so that each is at least 1 us later than the
    /// stamp before.
    pub(crate) moved: u64,
    /// Number of times so far that the wall clock was set back by more than 30 s.
    steps_back: u32,
}

impl MonotoneStamps {
    /// Returns the stamp for the time `nanoseconds` of the wall clock. A stamp that would be less
    /// than 1 us after the previous stamp is moved forwards to 1 us after it.
    ///
    /// `steps_back` is the number of times that the wall clock was set back by more than 30 s
    /// ([`Clock::wall_steps_back`]). When it increases, the stamps go back with the clock.
    pub(crate) fn next(&mut self, nanoseconds: i64, steps_back: u32) -> Stamp {
        if std::mem::replace(&mut self.steps_back, steps_back) != steps_back {
            self.last_ns = 0;
        }
        let least = self.last_ns.saturating_add(1000);
        self.moved += u64::from(nanoseconds < least);
        self.last_ns = nanoseconds.max(least);
        Stamp::from_nanoseconds(self.last_ns)
    }
}

/// Stream decoded for `/neurodata_reconstructed`, and whether the bridge's model can decode it.
///
/// The stream depends on the streams that the bridge asks the device for, so it changes when the
/// device refuses one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Decoding {
    pub(crate) stream: DecodedStream,
    /// Whether the bridge has the device's model, and this model can decode the stream.
    pub(crate) is_possible: bool,
}

/// A stream from which electrode signals can be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DecodedStream {
    /// Codes of the autoencoder network.
    Codes,
    /// Packed blocks. They are decoded even if the device sends codes too.
    Packed,
}

impl DecodedStream {
    /// Returns which stream is decoded if the bridge asks the device for the streams `asked`.
    pub(crate) fn of(asked: Streams) -> DecodedStream {
        if asked.contains(Streams::PACKED) { DecodedStream::Packed } else { DecodedStream::Codes }
    }
}

impl Decoding {
    /// Returns whether electrode signals are decoded from `stream`.
    pub(crate) fn decodes(self, stream: DecodedStream) -> bool {
        self.is_possible && self.stream == stream
    }
}

impl Device {
    /// Returns the time from a frame's first sample at the electrodes until all data of the frame
    /// are acquired and filtered, microseconds. The transfer to the host is not included. `decoded`
    /// is the stream decoded for `/neurodata_reconstructed`.
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
                    // A frame is complete only after the next block has corrected it.
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

    /// Returns the time to add to the stamp of an event, microseconds, so that a recording of this
    /// stream has the event at the sample that was at the electrodes when the event happened.
    ///
    /// `rosneuro_recorder` assumes that its first sample was taken one frame's duration before the
    /// first frame arrived, and places an event by its stamp relative to that time. Its library,
    /// libxdffileio, rounds the position down and counts samples from 0, but GDF and its readers
    /// count from 1. Half a sample corrects the rounding, and one sample corrects the counting.
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

    /// Returns the number of samples in a frame of `stream`, and their rate in Hz.
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
