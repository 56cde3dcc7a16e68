//! Size of a frame: the bytes that a chain sends per sample.

/// Channels per chip.
pub const CHANNELS: usize = 8;

/// Bytes per chip in a frame: 24 status bits and eight 24-bit counts (data sheet section 9.4.4).
pub const CHIP_BYTES: usize = 3 + 3 * CHANNELS;

/// Longest chain, in chips. With eight chips the don't-care bits still fit into the frame's extra
/// byte.
pub const MAX_CHIPS: usize = 8;

/// Returns the number of bytes to clock per frame: 27 per chip, and one for the don't-care bits
/// that the chain may insert between chips. The result is 217 for eight chips.
pub const fn frame_bytes(chips: usize) -> usize {
    CHIP_BYTES * chips + 1
}
