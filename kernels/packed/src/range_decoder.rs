//! The decoder of a range encoder's number.

use crate::tables::{FREQUENCY_BITS, Frequencies, MAGNITUDES};

/// The range is at least this large between two symbols.
const LEAST_RANGE: u32 = 1 << 24;

/// Reads the symbols that [`RangeEncoder`](crate::range_encoder::RangeEncoder) wrote. Behind the last byte it
/// reads zeros.
#[derive(Clone, Debug)]
pub(crate) struct RangeDecoder<'b> {
    /// The number so far, minus the first number of the range.
    offset: u32,
    range: u32,
    bytes: &'b [u8],
    /// Number of bytes read, zeros behind the last byte included.
    read: usize,
}

impl<'b> RangeDecoder<'b> {
    pub(crate) fn new(bytes: &'b [u8]) -> Self {
        let mut decoder = Self {
            offset: 0,
            range: u32::MAX,
            bytes,
            read: 0,
        };
        for _ in 0..4 {
            decoder.pull_byte();
        }
        decoder
    }

    /// Returns the symbol whose frequencies contain the number: `starts` are the first frequencies of the
    /// symbols, ascending from 0; the last symbol's end at 2^15.
    pub(crate) fn symbol(&mut self, starts: &[u16; MAGNITUDES]) -> usize {
        let unit = self.range >> FREQUENCY_BITS;
        let frequency = (self.offset / unit).min((1 << FREQUENCY_BITS) - 1);
        let symbol = starts.partition_point(|&start| u32::from(start) <= frequency);
        let symbol = symbol.saturating_sub(1);
        self.consume(unit, Frequencies::of_magnitude(starts, symbol));
        symbol
    }

    /// Reads a bit that is as likely as not.
    pub(crate) fn bit(&mut self) -> bool {
        let unit = self.range >> 1;
        let bit = self.offset >= unit;
        let start = bit.into();
        self.consume(unit, Frequencies { start, count: 1 });
        bit
    }

    /// Returns true if bytes are left that no symbol has read.
    pub(crate) fn has_unread_bytes(&self) -> bool {
        self.read < self.bytes.len()
    }

    fn consume(&mut self, unit: u32, frequencies: Frequencies) {
        // Bytes that no encoder writes can leave the offset beyond the range: it wraps.
        self.offset = self
            .offset
            .wrapping_sub(unit.wrapping_mul(frequencies.start));
        self.range = unit.wrapping_mul(frequencies.count);
        while self.range < LEAST_RANGE {
            self.pull_byte();
            self.range <<= 8;
        }
    }

    fn pull_byte(&mut self) {
        let byte = self.bytes.get(self.read).copied().unwrap_or(0);
        self.offset = self.offset << 8 | u32::from(byte);
        self.read += 1;
    }
}
