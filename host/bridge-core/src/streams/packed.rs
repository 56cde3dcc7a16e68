//! The stream of packed blocks, from which the decoder reconstructs electrode signals.

use std::sync::Arc;

use link::{Flags, PackedCode};
use packed::{BlockReader, Rate};

use crate::core::Effects;
use crate::decoder::packed::{PackedBytes, TimedPackedBlock};
use crate::device::Device;
use crate::settings::{FillerPolicy, Settings};
use crate::streams::hop_timeline::{HopPlace, HopTimeline};
use crate::streams::ledger::PackedCounts;
use crate::streams::rows::NextRow;
use crate::streams::stamps::{DecodedStream, Decoding, MonotoneStamps, Reception};

/// Passes packed blocks, and placeholders for missing ones, to the decoder, each with its time.
///
/// Counts and stamps continue when the device restarts.
#[derive(Debug)]
pub(crate) struct PackedStream {
    pub(crate) timeline: HopTimeline,
    pub(crate) counts: PackedCounts,
    /// Rate of the newest packed block; `None` before the first block.
    pub(crate) rate: Option<u8>,
    /// Whether the next block will be the first of a recording.
    is_first: bool,
    pub(crate) stamps: MonotoneStamps,
    /// Number of blocks passed to the decoder so far, received or missing.
    pub(crate) passed: u64,
}

impl PackedStream {
    pub(crate) fn new(device: Arc<Device>, decoding: Decoding, settings: Settings) -> PackedStream {
        PackedStream {
            timeline: HopTimeline::new("packed blocks", device, decoding, settings),
            counts: PackedCounts::default(),
            rate: None,
            is_first: true,
            stamps: MonotoneStamps::default(),
            passed: 0,
        }
    }

    /// Sets which stream is decoded for `/neurodata_reconstructed`. If this changes, a new
    /// recording begins: the period in which codes were decoded would otherwise count as a gap in
    /// the packed blocks, and would be filled.
    pub(crate) fn set_decoding(&mut self, decoding: Decoding) {
        if self.timeline.decoding.stream != decoding.stream {
            self.end_recording();
        }
        self.timeline.decoding = decoding;
    }

    /// Ends the recording, because the user has stopped the stream. The pause is not filled.
    pub(crate) fn end_recording(&mut self) {
        self.timeline.end_recording();
        self.is_first = true;
    }

    /// Returns the next row of `/neurodata_reconstructed`, as [`HopTimeline::next_row`] does.
    /// `published` is the number of frames so far, including the newest block's frame, which may
    /// still wait to be corrected by the next block.
    pub(crate) fn next_row(&mut self, published: u64, run_us: Option<f64>) -> NextRow {
        let hop = self.timeline.device.hop_steps;
        self.timeline.next_row([published, hop.into()], [0, u32::from(hop) - 1], run_us)
    }

    /// Passes a block to the decoder, after placeholders for the blocks lost before it. The device
    /// made the block at `reception.device_us`; if that is `None`, its index gives the time.
    pub(crate) fn receive(
        &mut self,
        code: &PackedCode,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let most = effects.max_fillers();
        let placed = self.timeline.receive(code.block, reception, most);
        let Some((missing, place)) = placed else {
            return;
        };
        if self.timeline.settings.filler != FillerPolicy::Off {
            self.timeline.count_fillers(missing.len());
        }
        for place in missing {
            self.pass_on(place, Flags::FILLER, None, reception, effects);
        }
        self.count(code);
        let block = PackedBytes { bytes: code.bytes.to_vec(), rate: code.rate };
        self.pass_on(place, code.flags, Some(block), reception, effects);
    }

    /// Counts a received block, by its flags and header. The decoder counts malformed blocks.
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
        if !self.timeline.decoding.decodes(DecodedStream::Packed) {
            return;
        }
        let device = &self.timeline.device;
        let hop = u32::from(device.hop_steps);
        let end = (u64::from(place.index) + 1) * u64::from(hop);
        let last_sample = device.sample_of_step(end - 1);
        let words = place.words(flags, last_sample, reception);
        let steps = [hop - 1, hop];
        let time = self.timeline.frame_time_ns(place, steps, reception);
        let steps_back = reception.clock.wall_steps_back();
        self.passed += 1;
        effects.decode_block(TimedPackedBlock {
            block,
            is_first,
            stamp: self.stamps.next(time, steps_back),
            words,
        });
    }
}
