//! What a file of codes holds, and how many packed blocks.

/// What a file of codes holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum EncodedStream {
    /// Codes of the network.
    #[default]
    Codes,
    /// Packed blocks, at this rate, 0 to 15; `None` for the model's.
    Packed(Option<u8>),
}

/// Packed blocks that were made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PackedCount {
    /// Number of blocks.
    pub blocks: u64,
    /// Number of bits of all blocks.
    pub bits: u64,
}
