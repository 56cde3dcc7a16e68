//! A device that streams packed blocks with the built-in model.

use bridge::{AnnouncedStream, Settings};
use link::{Flags, PackedCode, Streams, ToHost};
use packed::{Context, Header, Magnitude, Rate, Tables};

use crate::board::{Board, model};
use crate::recorder::{Harness, SETTINGS};

/// Settings of a bridge that reconstructs from packed blocks and asks for nothing else.
pub(crate) const PACKED: Settings = Settings {
    streams: Streams::PACKED,
    announced: AnnouncedStream::Reconstructed,
    low_latency: true,
    ..SETTINGS
};

/// Blocks from one without prediction to the next.
const RESET_BLOCKS: u32 = 64;

/// Returns block `index` of a run: pseudo-random magnitudes, which depend on `seed`.
pub(crate) fn block(index: u32, seed: u32, rate: u8) -> Vec<u8> {
    let model = model();
    let packed = model.packed().unwrap();
    let rate = Rate::new(rate).unwrap();
    let header = Header {
        rate,
        is_reset: index.is_multiple_of(RESET_BLOCKS),
    };
    let levels = if header.is_reset {
        &packed.reset_levels
    } else {
        &packed.predicted_levels
    };
    let mut contexts = vec![Context::EMPTY; levels.len()];
    packed::prepare_contexts(levels, rate, &mut contexts);
    let costs = packed.costs();
    let tables = Tables {
        starts: &packed.starts,
        costs: &costs,
    };
    let mut state = index.wrapping_mul(0x9e37_79b9) ^ seed | 1;
    let magnitudes: Vec<Magnitude> = (0..levels.len())
        .map(|place| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            let value = if place < 12 { state % 3 } else { 0 };
            Magnitude {
                value: u16::try_from(value).unwrap(),
                is_negative: state & 8 != 0,
            }
        })
        .collect();
    let mut bytes = [0; 300];
    let length = packed::write_block(header, rate, &magnitudes, &contexts, &tables, &mut bytes);
    bytes[..length].to_vec()
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
        let mut harness = Harness::new(settings, Board::new());
        harness.connect();
        Packed {
            harness,
            next: 0,
            rate: 4,
            flags: Flags::empty(),
        }
    }

    /// Advances time by one hop, in which the device makes the next block. It reaches the bridge unless `lost`.
    pub(crate) fn send(&mut self, lost: bool) {
        let bytes = block(self.next, 0, self.rate);
        self.send_bytes(&bytes, lost);
    }

    /// Advances time by one hop, in which the device makes a block with these bytes. It reaches the bridge unless `lost`.
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
