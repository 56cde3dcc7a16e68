//! The same contenders on this PC: what an image has to give, bit for bit.

use bench::block::{self, BLOCKS};
use bench::contender::with_contenders;

use super::inputs::Inputs;

/// The file that an image would write.
pub(crate) fn outputs(inputs: &Inputs) -> Vec<u8> {
    let mut bytes = Vec::new();
    for input in inputs.blocks.chunks(BLOCKS) {
        with_contenders(|mut contenders| {
            for block in input {
                for contender in &mut contenders {
                    contender.take(block);
                    contender.run();
                    bytes.extend(block::to_bytes(&contender.give()));
                }
            }
        });
    }
    bytes
}
