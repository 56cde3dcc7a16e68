//! A device that streams packed blocks with the built-in model.

use artifact::reconstruction::PackedDecoder;
use bridge_core::{AnnouncedStream, PackedReconstruction, Settings};
use link::{Flags, PackedCode, Streams, ToHost};
use neuro_ros::NeuroFrame;
use packed::Rate;

use crate::board::{Board, model};
use crate::packed_block::block;
use crate::recorder::{Harness, Recorder, SETTINGS};

/// Settings of a bridge that reconstructs from packed blocks and asks for nothing else.
pub(crate) const PACKED: Settings = Settings {
    streams: Streams::PACKED,
    announced: AnnouncedStream::Reconstructed,
    low_latency: true,
    ..SETTINGS
};

/// Returns the frames that the bridge's decoder makes of the blocks that the core has passed to it.
pub(crate) fn frames(recorder: &Recorder, settings: Settings) -> Vec<NeuroFrame> {
    let announced = &recorder.announced[0].device;
    let mut decoder = PackedReconstruction::new(announced, &model(), settings).unwrap();
    let mut frames = Vec::new();
    for number in 0..=recorder.blocks.len() {
        if recorder.finished.contains(&number) {
            frames.extend(decoder.finish().cloned());
        }
        let block = recorder.blocks.get(number);
        frames.extend(block.and_then(|block| decoder.next_frame(block).cloned()));
    }
    frames
}

/// Returns the flags of frames.
pub(crate) fn flags(frames: &[NeuroFrame]) -> Vec<u16> {
    let words = frames.iter().map(|frame| frame.tri.data[0]);
    words.map(|word| u16::try_from(word).unwrap()).collect()
}

/// Signals of blocks at once, and of the block before each one, corrected by it.
type Decoded = (Vec<Vec<f32>>, Vec<Option<Vec<f32>>>);

/// Decodes the blocks `received` of a run as the library does: `None` for a lost one.
pub(crate) fn decode(received: impl Iterator<Item = Option<u32>>) -> Decoded {
    let mut decoder = PackedDecoder::new(model().packed().unwrap());
    let rate = Rate::new(4).unwrap();
    received
        .map(|index| match index {
            Some(index) => {
                let decoded = decoder.decode(&block(index, 0, 4), rate).unwrap();
                (decoded.microvolts, decoded.smoothed)
            }
            None => (decoder.skip(), None),
        })
        .unzip()
}

/// A bridge, and a device that streams packed blocks to it.
pub(crate) struct Packed {
    pub(crate) harness: Harness,
    /// Index of the next block.
    pub(crate) next: u32,
    pub(crate) rate: u8,
    pub(crate) flags: Flags,
}

impl Packed {
    pub(crate) fn new(settings: Settings) -> Packed {
        Packed::of(Harness::connected(settings, Board::new()))
    }

    /// Creates a device whose next block is the first of a run.
    pub(crate) fn of(harness: Harness) -> Packed {
        Packed {
            harness,
            next: 0,
            rate: 4,
            flags: Flags::empty(),
        }
    }

    /// Advances time by one hop, in which the device makes the next block. It reaches the bridge
    /// unless `lost`.
    pub(crate) fn send(&mut self, lost: bool) {
        let bytes = block(self.next, 0, self.rate);
        self.send_bytes(&bytes, lost);
    }

    /// Advances time by `count` hops as [`Self::send`] does.
    pub(crate) fn send_all(&mut self, count: u32, lost: bool) {
        (0..count).for_each(|_| self.send(lost));
    }

    /// Advances time by one hop, in which the device makes a block with these bytes. It reaches the
    /// bridge unless `lost`.
    pub(crate) fn send_bytes(&mut self, bytes: &[u8], lost: bool) {
        self.harness.now_us += 62_500;
        let us = self.harness.now_us.unsigned_abs();
        let message = ToHost::PackedCode(PackedCode {
            block: self.next,
            rate: self.rate,
            flags: self.flags,
            clipped: 0,
            saturated: 0,
            bytes,
        });
        self.next += 1;
        let frame = self.harness.board.frame(us, &message);
        if !lost {
            self.harness.receive(&frame);
        }
    }
}
