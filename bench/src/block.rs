//! What goes in and comes out: four samples of every electrode.

use fixed_dsp::BLOCK;
use model::ELECTRODES;

/// Four consecutive samples of each electrode: counts x 2^5 (Q27.5), |x| <= 2^28 at
/// the input.
pub type Block = [[i32; BLOCK]; ELECTRODES];

/// Silence.
pub const SILENCE: Block = [[0; BLOCK]; ELECTRODES];

/// Bytes of a block in a file: electrode by electrode, little endian.
pub const BYTES: usize = 4 * BLOCK * ELECTRODES;

/// Blocks of one input: 2 s at 512 Hz. Every input starts with all contenders at rest.
pub const BLOCKS: usize = 256;

/// The image's input in its working folder: input by input, [`BLOCKS`] blocks each.
pub const INPUTS: &str = "inputs.bin";

/// The image's output there: for each block of [`INPUTS`] one block of each contender.
pub const OUTPUTS: &str = "outputs.bin";

/// The block as it lies in a file.
pub fn to_bytes(block: &Block) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    let words = bytes.as_chunks_mut().0;
    for (word, value) in words.iter_mut().zip(block.as_flattened()) {
        *word = value.to_le_bytes();
    }
    bytes
}

/// The block that lies in a file as `bytes`.
pub fn from_bytes(bytes: &[u8; BYTES]) -> Block {
    let mut block = SILENCE;
    for (value, word) in block.as_flattened_mut().iter_mut().zip(bytes.as_chunks().0) {
        *value = i32::from_le_bytes(*word);
    }
    block
}
