//! Reconstruction of electrode signals from packed blocks.

use std::collections::VecDeque;
use std::sync::Arc;

use link::Flags;
use neuro_ros::{NeuroFrame, Stamp};
use packed::Rate;
use reconstruction::PackedDecoder;

use crate::decoder::model::Model;
use crate::device::Device;
use crate::settings::{FillerPolicy, Settings};
use crate::streams::tri::TriWords;

/// Number of the newest blocks that are kept for audits: 1 s of the default model.
const KEPT_BLOCKS: usize = 16;

/// Input of the decoder: a received block, or a placeholder for a lost one, with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedBlock {
    /// The block; `None` if it was lost or is malformed.
    pub block: Option<Block>,
    /// Whether it is the first block of a recording: it does not follow the block before.
    pub is_first: bool,
    /// Stamp of the `/neurodata_reconstructed` frame with the block's steps.
    pub stamp: Stamp,
    /// Status words of the block.
    pub words: TriWords,
}

/// A block of the packed code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The bytes of the received message.
    pub bytes: Vec<u8>,
    /// Rate of the stream.
    pub rate: Rate,
}

/// Decodes packed blocks to frames of `/neurodata_reconstructed`, one for each block.
///
/// With low latency, a block yields its own frame. Otherwise it yields the frame of the block before, corrected by
/// what the newer block says about it.
#[derive(Debug)]
pub struct PackedReconstruction {
    decoder: PackedDecoder,
    low_latency: bool,
    filler: FillerPolicy,
    full_scale_uv: f32,
    /// Frame of the newest block, until the next one has corrected it; `None` with low latency.
    held: Option<Held>,
    /// Index and signals of the newest blocks, without correction.
    kept: VecDeque<(u32, Vec<f32>)>,
    /// Number of received blocks that were malformed and count as lost.
    malformed: u64,
    frame: NeuroFrame,
}

#[derive(Debug)]
struct Held {
    microvolts: Vec<f32>,
    stamp: Stamp,
    words: TriWords,
}

impl PackedReconstruction {
    /// Creates a reconstruction for a device whose model is `model`; `None` if that model has no packed code.
    pub fn new(
        device: &Device,
        model: &Arc<Model>,
        settings: Settings,
    ) -> Option<PackedReconstruction> {
        #[expect(clippy::cast_possible_truncation, reason = "187500, exact in f32")]
        let full_scale_uv = device.full_scale_uv as f32;
        Some(PackedReconstruction {
            decoder: PackedDecoder::new(model.packed()?),
            low_latency: settings.low_latency,
            filler: settings.filler,
            full_scale_uv,
            held: None,
            kept: VecDeque::new(),
            malformed: 0,
            frame: device.unpacked_frame(),
        })
    }

    /// Sets the sequence number of the newest frame on the topic; the next one follows it.
    pub(crate) fn set_number(&mut self, number: u32) {
        self.frame.header.seq = number;
        self.frame.neuroheader.seq = number;
    }

    /// Sequence number of the newest frame.
    pub(crate) fn number(&self) -> u32 {
        self.frame.neuroheader.seq
    }

    /// Continues the frames of `before`, which another device sent: the frame that it still holds comes first. The
    /// frames of both reconstructions must have the same shape.
    pub(crate) fn continue_from(&mut self, before: &mut PackedReconstruction) {
        self.set_number(before.number());
        self.held = before.held.take();
        self.malformed = before.malformed;
    }

    /// Number of received blocks that were malformed: their bytes are no block of this model.
    pub(crate) fn malformed(&self) -> u64 {
        self.malformed
    }

    /// Returns the signals of block `index` as they were decoded at once, microvolts, in the order step, electrode;
    /// `None` if it was lost or is too old.
    pub(crate) fn signals(&self, index: u32) -> Option<&[f32]> {
        let kept = self.kept.iter().find(|(kept, _)| *kept == index);
        kept.map(|(_, microvolts)| microvolts.as_slice())
    }

    /// Decodes `block` and returns the frame that it completes: that of the block before, with low latency its own.
    /// Returns `None` if there is no such block, or if it is lost and lost blocks are not filled.
    pub fn next_frame(&mut self, block: &TimedBlock) -> Option<&NeuroFrame> {
        if block.is_first {
            self.decoder.restart();
            self.held = None;
            self.kept.clear();
        }
        let received = block.block.as_ref();
        let decoded = received.map(|block| self.decoder.decode(&block.bytes, block.rate));
        self.malformed += u64::from(matches!(decoded, Some(Err(_))));
        let decoded = decoded.and_then(Result::ok);
        let mut words = block.words;
        let mut smoothed = None;
        let microvolts = if let Some(decoded) = decoded {
            if !decoded.is_sound {
                words.flags |= Flags::HEALING.bits();
            }
            smoothed = decoded.smoothed;
            self.keep(words.window, &decoded.microvolts);
            decoded.microvolts
        } else {
            words.flags |= Flags::FILLER.bits();
            self.decoder.skip()
        };
        let newest = Held {
            microvolts,
            stamp: block.stamp,
            words,
        };
        let mut due = if self.low_latency {
            newest
        } else {
            self.held.replace(newest)?
        };
        let is_lost = due.words.flags & Flags::FILLER.bits() != 0;
        if is_lost && self.filler == FillerPolicy::Zeros {
            due.microvolts.fill(0.0);
        } else if let Some(smoothed) = smoothed
            && !self.low_latency
        {
            due.microvolts = smoothed;
        }
        if is_lost && self.filler == FillerPolicy::Off {
            return None;
        }
        Some(self.finish_frame(&due))
    }

    fn keep(&mut self, index: u32, microvolts: &[f32]) {
        self.kept.truncate(KEPT_BLOCKS - 1);
        self.kept.push_front((index, microvolts.to_vec()));
    }

    fn finish_frame(&mut self, due: &Held) -> &NeuroFrame {
        let frame = &mut self.frame;
        frame.neuroheader.seq = frame.neuroheader.seq.wrapping_add(1);
        frame.header.seq = frame.neuroheader.seq;
        frame.header.stamp = due.stamp;
        let range = -self.full_scale_uv..=self.full_scale_uv;
        for (place, value) in frame.eeg.data.iter_mut().zip(&due.microvolts) {
            // A recorder stores values outside the announced range as infinite.
            *place = value.clamp(*range.start(), *range.end());
        }
        for row in frame.tri.data.chunks_exact_mut(8) {
            row.copy_from_slice(&due.words.words());
        }
        frame
    }
}
