//! The stream of packed blocks, which are decoded to `/neurodata_reconstructed`.

use std::sync::Arc;

use link::{Flags, PackedCode};
use packed::{BlockReader, Rate};

use crate::core::Effects;
use crate::decoder::packed::{PackedBytes, TimedPackedBlock};
use crate::device::Device;
use crate::settings::{FillerPolicy, Settings};
use crate::streams::hop_timeline::{HopDurations, HopPlace, HopTimeline, MissingStretch};
use crate::streams::ledger::{HopCounts, PackedCounts};
use crate::streams::neuro_frames::TriWords;
use crate::streams::stamps::{
    DecodedStream, Decoding, FrameSteps, MonotoneStamps, Reception, frame_time_ns,
};

/// Places packed blocks in time and passes them to the decoder, with a placeholder for each missing one.
///
/// Counts and stamps persist while the bridge runs, across restarts of the device.
#[derive(Debug)]
pub(crate) struct PackedStream {
    settings: Settings,
    device: Arc<Device>,
    decoding: Decoding,
    timeline: HopTimeline,
    counts: PackedCounts,
    /// Rate of the newest block.
    rate: Option<u8>,
    /// Whether the next block is the first of a recording.
    is_first: bool,
    stamps: MonotoneStamps,
}

impl PackedStream {
    pub(crate) fn new(device: Arc<Device>, decoding: Decoding, settings: Settings) -> PackedStream {
        PackedStream {
            settings,
            device,
            decoding,
            timeline: HopTimeline::new("packed blocks"),
            counts: PackedCounts::default(),
            rate: None,
            is_first: true,
            stamps: MonotoneStamps::default(),
        }
    }

    /// Switches to another device of the same shape, or to the same device with another mains
    /// frequency. Counts and stamps continue.
    pub(crate) fn replace_device(&mut self, device: Arc<Device>) {
        self.device = device;
    }

    /// Sets which stream is decoded to `/neurodata_reconstructed`. The time in which another one was is no gap.
    pub(crate) fn set_decoding(&mut self, decoding: Decoding) {
        if self.decoding.stream != decoding.stream {
            self.end_recording();
        }
        self.decoding = decoding;
    }

    /// Starts another run. Call this when the device counts blocks from 0 again. The time until the
    /// run's first block is filled.
    pub(crate) fn restart(&mut self) {
        self.timeline.restart();
    }

    /// Ends the recording, because the user stopped the stream. The time until the next start is not
    /// filled.
    pub(crate) fn end_recording(&mut self) {
        self.timeline.end_recording();
        self.is_first = true;
    }

    /// Returns the newest stretch of missing blocks once. It starts where the frames do.
    pub(crate) fn take_missing(&mut self) -> Option<MissingStretch> {
        self.timeline.take_missing()
    }

    /// Numbers of received and missing blocks.
    pub(crate) fn hops(&self) -> &HopCounts {
        self.timeline.counts()
    }

    pub(crate) fn counts(&self) -> &PackedCounts {
        &self.counts
    }

    /// Rate of the newest block; `None` before the first one.
    pub(crate) fn rate(&self) -> Option<u8> {
        self.rate
    }

    /// Returns the number of stamps that were moved forwards, because they were not at least 1 us
    /// later than the previous stamp.
    pub(crate) fn moved_stamps(&self) -> u64 {
        self.stamps.moved()
    }

    /// Returns whether `code` shows that the device restarted its stream without a command.
    pub(crate) fn is_restart(&self, code: &PackedCode) -> bool {
        self.timeline.is_restart(code.block)
    }

    /// Passes a block that the device made at `device_us` to the decoder, after placeholders for the
    /// blocks lost before it.
    ///
    /// `device_us` is `None` if the frame's device time was impossible. The time is then computed
    /// from the block's index.
    pub(crate) fn receive(
        &mut self,
        code: &PackedCode,
        device_us: Option<u64>,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let durations = self.durations();
        let most = effects.max_fillers();
        let Some((missing, place)) = self
            .timeline
            .receive(code.block, device_us, durations, reception, most)
        else {
            return;
        };
        if self.settings.filler != FillerPolicy::Off {
            self.timeline.count_fillers(missing.len());
        }
        for place in missing {
            self.pass_on(place, Flags::FILLER, None, reception, effects);
        }
        self.count(code);
        let block = PackedBytes {
            bytes: code.bytes.to_vec(),
            rate: code.rate,
        };
        self.pass_on(place, code.flags, Some(block), reception, effects);
    }

    /// Counts a block by its status. The decoder counts malformed blocks.
    fn count(&mut self, code: &PackedCode) {
        self.rate = Some(code.rate);
        let counts = &mut self.counts;
        counts.bits += 8 * code.bytes.len() as u64;
        counts.clipped += u64::from(code.clipped);
        if !code.flags.contains(Flags::SETTLING) {
            counts.misfits += u64::from(code.flags.contains(Flags::MISFIT));
            counts.blanks += u64::from(code.flags.contains(Flags::BLANK));
        }
        let reader = Rate::new(code.rate).and_then(|rate| BlockReader::new(code.bytes, rate).ok());
        if let Some(header) = reader.map(|reader| reader.header()) {
            counts.resets += u64::from(header.is_reset);
            counts.coarser += u64::from(header.rate.index() > code.rate);
        }
    }

    fn durations(&self) -> HopDurations {
        let settings = &self.settings;
        let lookback_us =
            self.device
                .frame_lookback_us(settings.announced, self.decoding.stream, settings);
        HopDurations::new(&self.device, lookback_us)
    }

    fn pass_on(
        &mut self,
        place: HopPlace,
        flags: Flags,
        block: Option<PackedBytes>,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        self.timeline.record(place, reception);
        let is_first = std::mem::take(&mut self.is_first);
        if !self.decoding.decodes(DecodedStream::Packed) {
            return;
        }
        let hop = u32::from(self.device.hop_steps);
        let end = (u64::from(place.index) + 1) * u64::from(hop);
        let last_sample = self.device.sample_of_step(end - 1);
        let words = TriWords {
            flags: flags.bits(),
            window: place.index,
            device_time_us: u64::try_from(place.device_us).unwrap_or(0),
            lost: place.missing,
            trigger: reception.trigger.level_at(last_sample),
        };
        let steps = FrameSteps {
            lookback: hop - 1,
            length: hop,
        };
        let (device, point) = (&self.device, self.settings.stamp);
        let time = frame_time_ns(device, point, place.device_us, steps, reception);
        let steps_back = reception.clock.wall_steps_back();
        effects.decode_block(TimedPackedBlock {
            block,
            is_first,
            stamp: self.stamps.next(time, steps_back),
            words,
        });
    }
}
