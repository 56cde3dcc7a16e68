//! A simulated device that streams packed blocks of the embedded model.

use artifact::reconstruction::PackedDecoder;
use bridge_core::{AnnouncedStream, PackedReconstruction, Settings};
use link::{Flags, PackedCode, Streams, ToHost};
use neuro_ros::NeuroFrame;
use packed::Rate;

use crate::board::{Board, model};
use crate::packed_block::block;
use crate::recorder::{Harness, Recorder, SETTINGS};

/// Settings of a bridge that asks for packed blocks alone and decodes signals from them.
pub(crate) const PACKED: Settings = Settings {
    streams: Streams::PACKED,
    announced: AnnouncedStream::Reconstructed,
    low_latency: true,
    ..SETTINGS
};

/// Returns the frames that the decoder makes from the blocks that the core passed to `recorder`.
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

/// Returns the flags of each frame's first step.
pub(crate) fn flags(frames: &[NeuroFrame]) -> Vec<u16> {
    let words = frames.iter().map(|frame| frame.tri.data[0]);
    words.map(|word| u16::try_from(word).unwrap()).collect()
}

/// For each block of a run: its signals, and the previous block's signals corrected by this block.
type Decoded = (Vec<Vec<f32>>, Vec<Option<Vec<f32>>>);

/// Decodes a run with a new decoder. `received` holds the blocks' indices, `None` for lost ones.
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

/// A bridge, and a simulated device that streams packed blocks to it.
pub(crate) struct Packed {
    pub(crate) harness: Harness,
    /// Index of the block that the device makes next.
    pub(crate) next: u32,
    pub(crate) rate: u8,
    pub(crate) flags: Flags,
}

impl Packed {
    pub(crate) fn new(settings: Settings) -> Packed {
        Packed::of(Harness::connected(settings, Board::new()))
    }

    /// Creates a device on the board of `harness`. Its next block is the first of a run.
    pub(crate) fn of(harness: Harness) -> Packed {
        Packed { harness, next: 0, rate: 4, flags: Flags::empty() }
    }

    /// Advances time by one hop, in which the device makes its next block. The block reaches the
    /// bridge unless it is `lost`.
    pub(crate) fn send(&mut self, lost: bool) {
        let bytes = block(self.next, 0, self.rate);
        self.send_bytes(&bytes, lost);
    }

    /// Sends `count` blocks, one per hop. If `lost`, none of them reaches the bridge.
    pub(crate) fn send_all(&mut self, count: u32, lost: bool) {
        (0..count).for_each(|_| self.send(lost));
    }

    /// Advances time by one hop, in which the device makes a block with these `bytes`. The block
    /// reaches the bridge unless it is `lost`.
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
