//! Reconstruction of electrode signals from packed blocks.

use std::collections::VecDeque;
use std::sync::Arc;

use artifact::reconstruction::{PackedHop, PackedOverlap, PackedSource};
use link::Flags;
use neuro_ros::{NeuroFrame, Stamp, TriWords};

use crate::decoder::model::Model;
use crate::device::Device;
use crate::settings::{FillerPolicy, Settings};

/// Number of the newest blocks that are kept for audits: 1 s of the default model.
const KEPT_BLOCKS: usize = 16;

/// Input of the decoder: a received block, or a placeholder for a lost one, with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedPackedBlock {
    /// The block; `None` if it was lost.
    pub block: Option<PackedBytes>,
    /// Whether it is the first block of a recording: it does not follow the block before.
    pub is_first: bool,
    /// Stamp of the `/neurodata_reconstructed` frame with the block's steps.
    pub stamp: Stamp,
    /// Status words of the block.
    pub words: TriWords,
}

/// A block of the packed code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedBytes {
    /// The bytes of the received message.
    pub bytes: Vec<u8>,
    /// Rate of the stream, 0 to 15; with a larger one the block counts as malformed.
    pub rate: u8,
}

/// Decodes packed blocks to frames of `/neurodata_reconstructed`, one for each block.
///
/// With low latency, a block yields its own frame. Otherwise it yields the frame of the block
/// before, corrected by the newer block.
#[derive(Debug)]
pub struct PackedReconstruction {
    overlap: PackedOverlap<Label>,
    filler: FillerPolicy,
    /// Index and uncorrected signals, microvolts, of the newest blocks, for audits.
    kept: VecDeque<(u32, Vec<f32>)>,
    frame: NeuroFrame,
}

/// Stamp and status words of a block, which stay with its signals until they are published.
#[derive(Clone, Copy, Debug)]
struct Label {
    stamp: Stamp,
    words: TriWords,
}

impl PackedReconstruction {
    /// Creates a reconstruction for a device whose model is `model`; `None` if that model has no
    /// packed code.
    pub fn new(
        device: &Device,
        model: &Arc<Model>,
        settings: Settings,
    ) -> Option<PackedReconstruction> {
        // A recorder stores values outside the announced range as infinite.
        #[expect(clippy::cast_possible_truncation, reason = "187500, exact in f32")]
        let full_scale_uv = device.full_scale_uv as f32;
        Some(PackedReconstruction {
            overlap: PackedOverlap::new(model.packed()?, settings.low_latency, full_scale_uv),
            filler: settings.filler,
            kept: VecDeque::new(),
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

    /// Continues the frames of `before`, the reconstruction for another device: the frame that
    /// still waits in `before` comes first. The frames of both must have the same shape.
    pub fn continue_from(&mut self, before: &mut PackedReconstruction) {
        self.set_number(before.number());
        self.overlap.continue_from(&mut before.overlap);
    }

    /// Number of received blocks whose bytes are no block of this model.
    pub fn malformed(&self) -> u64 {
        self.overlap.malformed()
    }

    /// Returns the signals of block `index` without the correction by the next block, microvolts,
    /// in the order step, electrode; `None` if the block was lost or is no longer kept.
    pub(crate) fn signals(&self, index: u32) -> Option<&[f32]> {
        let kept = self.kept.iter().find(|(kept, _)| *kept == index);
        kept.map(|(_, microvolts)| microvolts.as_slice())
    }

    /// Returns the frame that waits for the next block, without its correction, because no block
    /// follows; `None` if none waits, or if its block is lost and lost blocks are not filled.
    pub fn finish(&mut self) -> Option<&NeuroFrame> {
        let hop = self.overlap.finish()?;
        self.filled_frame(hop)
    }

    /// Decodes `block` and returns the frame that it completes: that of the block before, or with
    /// low latency its own. Returns `None` before the second block, or if the completed frame is
    /// that of a lost block and lost blocks are not filled.
    pub fn next_frame(&mut self, block: &TimedPackedBlock) -> Option<&NeuroFrame> {
        self.start_recording(block.is_first);
        let received = block.block.as_ref();
        let received = received.map(|block| (block.bytes.as_slice(), block.rate));
        let label = Label {
            stamp: block.stamp,
            words: block.words,
        };
        let completed = self.overlap.next_hop(received, label);
        self.keep_newest();
        self.filled_frame(completed?)
    }

    /// Returns the frame that `block` completes as [`Self::next_frame`] does, but with zeros as
    /// values, because no block is decoded. For a caller that needs only the times.
    pub fn next_times(&mut self, block: &TimedPackedBlock) -> Option<&NeuroFrame> {
        self.start_recording(block.is_first);
        let source = match block.block {
            Some(_) => PackedSource::Block,
            None => PackedSource::Prediction,
        };
        let completed = self.overlap.pass(PackedHop {
            microvolts: vec![0.0; self.frame.eeg.data.len()],
            source,
            label: Label {
                stamp: block.stamp,
                words: block.words,
            },
        });
        self.filled_frame(completed?)
    }

    /// Forgets all blocks if the next one is the first of a recording.
    fn start_recording(&mut self, is_first: bool) {
        if is_first {
            self.overlap.restart();
            self.kept.clear();
        }
    }

    /// Returns the frame of a hop; `None` if its block is lost and lost blocks are not filled.
    fn filled_frame(&mut self, mut hop: PackedHop<Label>) -> Option<&NeuroFrame> {
        if hop.source == PackedSource::Prediction {
            match self.filler {
                FillerPolicy::Last => {}
                FillerPolicy::Zeros => hop.microvolts.fill(0.0),
                FillerPolicy::Off => return None,
            }
        }
        Some(self.finish_frame(&hop))
    }

    fn keep_newest(&mut self) {
        let newest = self.overlap.newest();
        if let Some(newest) = newest.filter(|hop| hop.source != PackedSource::Prediction) {
            self.kept.truncate(KEPT_BLOCKS - 1);
            let index = newest.label.words.window;
            self.kept.push_front((index, newest.microvolts.clone()));
        }
    }

    fn finish_frame(&mut self, hop: &PackedHop<Label>) -> &NeuroFrame {
        let frame = &mut self.frame;
        frame.neuroheader.seq = frame.neuroheader.seq.wrapping_add(1);
        frame.header.seq = frame.neuroheader.seq;
        frame.header.stamp = hop.label.stamp;
        frame.eeg.data.copy_from_slice(&hop.microvolts);
        let mut words = hop.label.words;
        words.flags |= match hop.source {
            PackedSource::Block => Flags::empty(),
            PackedSource::Healing => Flags::HEALING,
            PackedSource::Prediction => Flags::FILLER,
        }
        .bits();
        for row in frame.tri.data.chunks_exact_mut(8) {
            row.copy_from_slice(&words.words());
        }
        frame
    }
}
