//! The stream of codes, published on `/encoded` and passed to the decoder.

use std::sync::Arc;

use link::{Code, Flags};
use neuro_ros::NeuroFrame;

use crate::core::Effects;
use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::device::Device;
use crate::settings::{FillerPolicy, Settings};
use crate::streams::hop_timeline::{HopPlace, HopTimeline};
use crate::streams::ledger::CodeCounts;
use crate::streams::rows::NextRow;
use crate::streams::stamps::{DecodedStream, Decoding, MonotoneStamps, Reception};

/// Converts codes to NeuroFrames for `/encoded` and to input for the decoder. Replaces lost codes
/// by fillers.
///
/// When the device restarts, the frames keep their shape, and sequence numbers and counts continue.
#[derive(Debug)]
pub(crate) struct CodeStream {
    pub(crate) timeline: HopTimeline,
    frame: NeuroFrame,
    z: Vec<f32>,
    /// Whether `z` holds the newest code of this recording, which a filler can repeat.
    has_last: bool,
    /// Whether the newest signals were decoded from packed blocks. If so, codes missing before the
    /// device's present run leave no gap in the decoded signals and are not passed to the decoder.
    follows_other: bool,
    pub(crate) counts: CodeCounts,
    encoded_stamps: MonotoneStamps,
    window_stamps: MonotoneStamps,
    /// Number of codes passed to the decoder so far, including those passed as missing.
    pub(crate) passed: u64,
}

impl CodeStream {
    pub(crate) fn new(device: Arc<Device>, decoding: Decoding, settings: Settings) -> CodeStream {
        CodeStream {
            frame: device.encoded_frame(),
            z: vec![0.0; device.numbers()],
            timeline: HopTimeline::new("codes", device, decoding, settings),
            has_last: false,
            follows_other: false,
            counts: CodeCounts::default(),
            encoded_stamps: MonotoneStamps::default(),
            window_stamps: MonotoneStamps::default(),
            passed: 0,
        }
    }

    /// Switches to another device with frames of the same shape, or to the same device with another
    /// mains frequency. Sequence numbers, counts and stamps continue.
    pub(crate) fn replace_device(&mut self, device: Arc<Device>) {
        let numbers = (self.frame.header.seq, self.frame.neuroheader.seq);
        self.frame = device.encoded_frame();
        (self.frame.header.seq, self.frame.neuroheader.seq) = numbers;
        self.timeline.device = device;
    }

    /// Sets which stream is decoded for `/neurodata_reconstructed`.
    pub(crate) fn set_decoding(&mut self, decoding: Decoding) {
        if self.timeline.decoding.stream != decoding.stream {
            self.follows_other = decoding.stream == DecodedStream::Codes;
        }
        self.timeline.decoding = decoding;
    }

    /// Ends the recording, because the user has stopped the stream. The pause is not filled.
    pub(crate) fn end_recording(&mut self) {
        self.timeline.end_recording();
        self.has_last = false;
        self.z.fill(0.0);
    }

    /// Returns the properties of the device that makes the codes.
    pub(crate) fn device(&self) -> &Arc<Device> {
        &self.timeline.device
    }

    /// Returns the number of stamps that were moved forwards, so that each is at least 1 us later
    /// than the stamp before.
    pub(crate) fn moved_stamps(&self) -> u64 {
        self.encoded_stamps.moved + self.window_stamps.moved
    }

    /// Returns the next row of `/encoded`, as [`HopTimeline::next_row`] does.
    pub(crate) fn next_row(&mut self, run_us: Option<f64>) -> NextRow {
        let last = u32::from(self.device().window_steps) - 1;
        let published = self.frame.neuroheader.seq.into();
        self.timeline.next_row([published, 1], [0, last], run_us)
    }

    /// Returns the next row of `/neurodata_reconstructed` if this topic is decoded from codes.
    /// `published` is the number of frames published on the topic so far.
    pub(crate) fn next_decoded_row(&mut self, published: u64, run_us: Option<f64>) -> NextRow {
        let device = self.device();
        let (rows, last) = (device.hop_steps.into(), u32::from(device.window_steps) - 1);
        let low_latency = self.timeline.settings.low_latency;
        let first = last - Reconstruction::lookback_steps(device, low_latency);
        self.timeline.next_row([published, rows], [first, last], run_us)
    }

    /// Publishes a code, after fillers for the codes lost before it. The device made the code at
    /// `reception.device_us`. If this is `None`, the time follows from the window index.
    pub(crate) fn receive(
        &mut self,
        code: &Code,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let (format, numbers) = (code.values.format(), code.values.len());
        let device = &self.timeline.device;
        let expected = (device.model_id, device.code_format, device.numbers());
        if (code.model_id, format, numbers) != expected {
            self.counts.foreign += 1;
            return;
        }
        let most = effects.max_fillers();
        let placed = self.timeline.receive(code.window, reception, most);
        let Some((missing, place)) = placed else {
            return;
        };
        self.fill(&missing, reception, effects);
        let device = Arc::clone(&self.timeline.device);
        device.dequantise(&code.values, &mut self.z);
        self.has_last = true;
        self.counts.clipped += u64::from(code.clipped);
        self.counts.clipped_values += u64::from(code.clipped_values);
        self.publish(place, code.flags, true, reception, effects);
    }

    /// Publishes fillers for all codes before index `next` that have not arrived. `next` is the
    /// index of the code that the device makes next, as its `Stats` message reports it.
    pub(crate) fn fill_before(
        &mut self,
        next: u32,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let most = effects.max_fillers();
        let missing = self.timeline.fill_before(next, reception, most);
        self.fill(&missing, reception, effects);
    }

    /// For each missing code, publishes a filler unless the user wants none, and passes the code to
    /// the decoder as missing.
    fn fill(&mut self, missing: &[HopPlace], reception: Reception<'_>, effects: &mut dyn Effects) {
        if missing.is_empty() {
            return;
        }
        if self.timeline.settings.filler == FillerPolicy::Zeros || !self.has_last {
            self.z.fill(0.0);
        }
        if self.timeline.settings.filler != FillerPolicy::Off {
            self.timeline.count_fillers(missing.len());
        }
        for place in missing {
            self.publish(*place, Flags::FILLER, false, reception, effects);
        }
    }

    fn publish(
        &mut self,
        place: HopPlace,
        flags: Flags,
        received: bool,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        self.timeline.record(place, reception);
        let device = &self.timeline.device;
        let last_sample = device.last_sample(place.index);
        let words = place.words(flags, last_sample, reception);
        let steps_back = reception.clock.wall_steps_back();
        let window = u32::from(device.window_steps);
        if received || self.timeline.settings.filler != FillerPolicy::Off {
            let steps = [window - 1, window];
            let first = self.timeline.frame_time_ns(place, steps, reception);
            let frame = &mut self.frame;
            frame.header.stamp = self.encoded_stamps.next(first, steps_back);
            frame.neuroheader.seq = frame.neuroheader.seq.wrapping_add(1);
            frame.header.seq = frame.neuroheader.seq;
            frame.eeg.data.copy_from_slice(&self.z);
            frame.tri.data.copy_from_slice(&words.words());
            effects.publish_encoded(frame);
        }
        if place.is_made {
            self.follows_other = false;
        }
        let HopTimeline { device, settings, .. } = &self.timeline;
        if self.timeline.decoding.decodes(DecodedStream::Codes) && !self.follows_other {
            let lookback = Reconstruction::lookback_steps(device, settings.low_latency);
            let steps = [lookback, u32::from(device.hop_steps)];
            let time = self.timeline.frame_time_ns(place, steps, reception);
            let stamp = self.window_stamps.next(time, steps_back);
            let z = received.then(|| self.z.clone());
            self.passed += 1;
            effects.decode(TimedCode { z, stamp, words });
        }
    }
}
