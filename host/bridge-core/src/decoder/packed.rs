//! Reconstruction of the electrode signals from packed blocks.

use std::collections::VecDeque;
use std::sync::Arc;

use artifact::reconstruction::{PackedHop, PackedOverlap, PackedSource};
use link::Flags;
use neuro_ros::{NeuroFrame, Stamp, TriWords};

use crate::decoder::model::Model;
use crate::device::Device;
use crate::settings::{FillerPolicy, Settings};

/// Number of newest blocks whose signals are kept for audits: 1 s with the default model.
const KEPT_BLOCKS: usize = 16;

/// Input of the decoder: a received packed block, or a placeholder for a lost one, with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedPackedBlock {
    /// The received block; `None` for the placeholder of a lost block.
    pub block: Option<PackedBytes>,
    /// Whether this is a recording's first block, which does not continue from the block before.
    pub is_first: bool,
    /// Stamp of the `/neurodata_reconstructed` frame with the block's steps.
    pub stamp: Stamp,
    /// Status words of the block: flags, index, device time, number of losses and trigger level.
    pub words: TriWords,
}

/// A packed block as received, with its rate, which the decoder needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedBytes {
    /// Content of the block, as the device sent it.
    pub bytes: Vec<u8>,
    /// Rate of the packed code: 0 (finest) to 15 (coarsest), or larger in a malformed block.
    pub rate: u8,
}

/// Decodes packed blocks to frames of `/neurodata_reconstructed`, one for each block.
///
/// With low latency, a block yields its own frame at once. Otherwise a block yields the frame of
/// the previous block, after correcting it.
#[derive(Debug)]
pub struct PackedReconstruction {
    overlap: PackedOverlap<Label>,
    filler: FillerPolicy,
    /// For audits, the newest blocks: index of each block, and its signals in microvolts before the
    /// next block corrects them.
    kept: VecDeque<(u32, Vec<f32>)>,
    frame: NeuroFrame,
}

/// Stamp and status words of a block. They stay with the block's signals until these are published.
#[derive(Clone, Copy, Debug)]
struct Label {
    stamp: Stamp,
    words: TriWords,
}

impl PackedReconstruction {
    /// Creates a reconstruction for packed blocks of `device`, which has the model `model`; `None`
    /// if that model has no packed code.
    pub fn new(
        device: &Device,
        model: &Arc<Model>,
        settings: Settings,
    ) -> Option<PackedReconstruction> {
        // Decoded values are limited to full scale, because a recorder stores values outside the
        // announced range as infinite.
        #[expect(clippy::cast_possible_truncation, reason = "187500, exact in f32")]
        let full_scale_uv = device.full_scale_uv as f32;
        Some(PackedReconstruction {
            overlap: PackedOverlap::new(model.packed()?, settings.low_latency, full_scale_uv),
            filler: settings.filler,
            kept: VecDeque::new(),
            frame: device.unpacked_frame(),
        })
    }

    /// Sets the sequence number of the newest published frame; the next frame gets the next number.
    pub(crate) fn set_number(&mut self, number: u32) {
        self.frame.header.seq = number;
        self.frame.neuroheader.seq = number;
    }

    /// Returns the sequence number of the newest frame.
    pub(crate) fn number(&self) -> u32 {
        self.frame.neuroheader.seq
    }

    /// Continues the frames of `before`, the previous device's reconstruction. A frame of `before`
    /// that still waits for correction is published first. The frames of both must have the same
    /// shape.
    pub fn continue_from(&mut self, before: &mut PackedReconstruction) {
        self.set_number(before.number());
        self.overlap.continue_from(&mut before.overlap);
    }

    /// Returns the number of received blocks that could not be decoded, because their bytes are not
    /// a block of this model.
    pub fn malformed(&self) -> u64 {
        self.overlap.malformed()
    }

    /// Returns the signals of block `index` as they were before the next block corrected them,
    /// microvolts: all electrodes of the first step, then all electrodes of the next, and so on.
    /// `None` if the block was lost or is no longer kept.
    pub(crate) fn signals(&self, index: u32) -> Option<&[f32]> {
        let kept = self.kept.iter().find(|(kept, _)| *kept == index);
        kept.map(|(_, microvolts)| microvolts.as_slice())
    }

    /// Returns, uncorrected, the frame that waits for the next block. Call this when no block
    /// follows. `None` if no frame waits, or if its block is lost and the user wants no fillers.
    pub fn finish(&mut self) -> Option<&NeuroFrame> {
        let hop = self.overlap.finish()?;
        self.filled_frame(hop)
    }

    /// Decodes `block` and returns the frame that it completes: the previous block's frame, or with
    /// low latency the block's own. Returns `None` if there is no previous block, or if the block
    /// of the completed frame is lost and the user wants no fillers.
    pub fn next_frame(&mut self, block: &TimedPackedBlock) -> Option<&NeuroFrame> {
        self.start_recording(block.is_first);
        let received = block.block.as_ref();
        let received = received.map(|block| (block.bytes.as_slice(), block.rate));
        let label = Label { stamp: block.stamp, words: block.words };
        let completed = self.overlap.next_hop(received, label);
        self.keep_newest();
        self.filled_frame(completed?)
    }

    /// Returns the frame that [`Self::next_frame`] would return, but decodes no block and sets all
    /// values to zero. For a caller that needs only the times.
    pub fn next_times(&mut self, block: &TimedPackedBlock) -> Option<&NeuroFrame> {
        self.start_recording(block.is_first);
        let source = match block.block {
            Some(_) => PackedSource::Block,
            None => PackedSource::Prediction,
        };
        let completed = self.overlap.pass(PackedHop {
            microvolts: vec![0.0; self.frame.eeg.data.len()],
            source,
            label: Label { stamp: block.stamp, words: block.words },
        });
        self.filled_frame(completed?)
    }

    /// Forgets all earlier blocks if the next block is the first of a recording.
    fn start_recording(&mut self, is_first: bool) {
        if is_first {
            self.overlap.restart();
            self.kept.clear();
        }
    }

    /// Returns the frame with the signals of `hop`, or a filler if its block is lost; `None` if the
    /// block is lost and the user wants no fillers.
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
