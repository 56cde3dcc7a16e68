//! Makes blocks of the embedded model's packed code.

use packed::{Context, Header, Magnitude, Rate, Tables};

use crate::board::{Noise, model};

/// Number of blocks from one block without prediction to the next such block.
const RESET_BLOCKS: u32 = 64;

/// Returns block `index` of a run, with pseudo-random magnitudes that depend on `seed`.
pub(crate) fn block(index: u32, seed: u32, rate: u8) -> Vec<u8> {
    coarser_block(index, seed, [rate, rate])
}

/// Returns a block like [`block`], but quantised at the rate `rate`, although the stream has the
/// rate `announced`.
pub(crate) fn coarser_block(index: u32, seed: u32, [announced, rate]: [u8; 2]) -> Vec<u8> {
    let model = model();
    let packed = model.packed().unwrap();
    let [announced, rate] = [announced, rate].map(|rate| Rate::new(rate).unwrap());
    let header = Header { rate, is_reset: index.is_multiple_of(RESET_BLOCKS) };
    let levels = if header.is_reset { &packed.reset_levels } else { &packed.predicted_levels };
    let mut contexts = vec![Context::EMPTY; levels.len()];
    packed::prepare_contexts(levels, rate, &mut contexts);
    let costs = packed.costs();
    let tables = Tables { starts: &packed.starts, costs: &costs };
    let mut noise = Noise(index.wrapping_mul(0x9e37_79b9) ^ seed | 1);
    let magnitudes: Vec<Magnitude> = (0..levels.len())
        .map(|place| {
            let bits = noise.bits();
            let value = if place < 12 { bits % 3 } else { 0 };
            Magnitude { value: u16::try_from(value).unwrap(), is_negative: bits & 8 != 0 }
        })
        .collect();
    let mut bytes = [0; 300];
    let length =
        packed::write_block(header, announced, &magnitudes, &contexts, &tables, &mut bytes);
    bytes[..length].to_vec()
}
