//! Blocks of samples that the image `lossless` compresses, and their byte layout in its input and
//! output files.

use lossless::{Block, Count, Encoder, Kind, MAX_SAMPLES};
use model::CHANNELS;

/// Samples of one block, as the lossless encoder takes them.
pub type Samples = [[Count; CHANNELS]; MAX_SAMPLES];

/// A block of samples that are all 0.
pub const SILENCE: Samples = [[[0; 3]; CHANNELS]; MAX_SAMPLES];

/// Number of bytes that the samples of one block take in the input file.
pub const INPUT_BYTES: usize = 3 * CHANNELS * MAX_SAMPLES;

/// Number of bytes that one compressed block takes in the output file: kind (1 byte), length (2),
/// and the compressed bytes, padded with zeros.
pub const OUTPUT_BYTES: usize = 1 + 2 + INPUT_BYTES;

/// Number of blocks in one input: 256 blocks are 4 s at 512 Hz.
pub const BLOCKS: usize = 256;

/// The encoder as in a device at 512 Hz: a key block every 0.25 s.
pub const ENCODER: Encoder = Encoder { key_blocks: 16 };

/// Returns the bytes that represent a compressed block in the output file.
pub fn to_bytes(block: &Block) -> [u8; OUTPUT_BYTES] {
    let mut bytes = [0; OUTPUT_BYTES];
    let [low, high, ..] = block.bytes.len().to_le_bytes();
    bytes[0] = match block.kind {
        Kind::Verbatim => 0,
        Kind::Key => 1,
        Kind::Continuing => 2,
    };
    bytes[1] = low;
    bytes[2] = high;
    bytes[3..][..block.bytes.len()].copy_from_slice(block.bytes);
    bytes
}

/// Returns the samples that are stored as `bytes` in the input file.
pub fn from_bytes(bytes: &[u8; INPUT_BYTES]) -> Samples {
    let mut samples = SILENCE;
    let places = samples.as_flattened_mut().as_flattened_mut();
    places.copy_from_slice(bytes);
    samples
}
