//! Four samples of every electrode: the unit of a contender's input and output.

use fixed_dsp::BLOCK;
use model::ELECTRODES;

/// Four consecutive samples of each electrode: counts x 2^5 (Q27.5), |x| <= 2^28 at
/// the input.
pub type Block = [[i32; BLOCK]; ELECTRODES];

/// A block of zeros.
pub const SILENCE: Block = [[0; BLOCK]; ELECTRODES];

/// Length of a block in a file, bytes: electrode by electrode, little endian.
pub const BYTES: usize = 4 * BLOCK * ELECTRODES;

/// Number of blocks in one input: 2 s at 512 Hz. The states of all contenders are zero at the start
/// of each input.
pub const BLOCKS: usize = 256;

/// File that an image reads: for `filters`, [`BLOCKS`] blocks of each input.
pub const INPUTS: &str = "inputs.bin";

/// File that an image writes: for `filters`, one block of each contender for each block of [`INPUTS`].
pub const OUTPUTS: &str = "outputs.bin";

/// Returns a block as it is stored in a file; [`BYTES`] states the order.
pub fn to_bytes(block: &Block) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    let words = bytes.as_chunks_mut().0;
    for (word, value) in words.iter_mut().zip(block.as_flattened()) {
        *word = value.to_le_bytes();
    }
    bytes
}

/// Returns the block that a file stores as `bytes`.
pub fn from_bytes(bytes: &[u8; BYTES]) -> Block {
    let mut block = SILENCE;
    for (value, word) in block.as_flattened_mut().iter_mut().zip(bytes.as_chunks().0) {
        *value = i32::from_le_bytes(*word);
    }
    block
}
