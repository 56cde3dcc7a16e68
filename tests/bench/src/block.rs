//! Four samples of every electrode: what a contender filters at a time.

use fixed_dsp::BLOCK;
use model::ELECTRODES;

/// Four consecutive samples of each electrode: counts x 2^5 (Q27.5). As input of a filter, |x| <=
/// 2^28.
pub type Block = [[i32; BLOCK]; ELECTRODES];

/// A block whose values are all 0.
pub const SILENCE: Block = [[0; BLOCK]; ELECTRODES];

/// Length of a block in the files of an image, bytes. Values are stored electrode by electrode, 32
/// bits each, little endian.
pub const BYTES: usize = 4 * BLOCK * ELECTRODES;

/// Number of blocks in one input: 256 blocks are 2 s at 512 Hz. The state of every filter is zero
/// at the start of each input.
pub const BLOCKS: usize = 256;

/// Name of the file that an image reads. For the image `filters` it holds [`BLOCKS`] blocks of each
/// input.
pub const INPUTS: &str = "inputs.bin";

/// Name of the file that an image writes. For each block of [`INPUTS`], the image `filters` writes
/// one block for each contender.
pub const OUTPUTS: &str = "outputs.bin";

/// Returns the bytes that store a block in a file, in the order that [`BYTES`] describes.
pub fn to_bytes(block: &Block) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    let words = bytes.as_chunks_mut().0;
    for (word, value) in words.iter_mut().zip(block.as_flattened()) {
        *word = value.to_le_bytes();
    }
    bytes
}

/// Returns the block that is stored as `bytes` in a file.
pub fn from_bytes(bytes: &[u8; BYTES]) -> Block {
    let mut block = SILENCE;
    for (value, word) in block.as_flattened_mut().iter_mut().zip(bytes.as_chunks().0) {
        *value = i32::from_le_bytes(*word);
    }
    block
}
