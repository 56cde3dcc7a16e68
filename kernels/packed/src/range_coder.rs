//! A range coder with a range of 32 bits: its encoder and its decoder.

use crate::tables::{FREQUENCY_BITS, Frequencies, MAGNITUDES};

/// Smallest range with which a symbol is coded. While the range is smaller, a byte is written or
/// read.
const LEAST_RANGE: u32 = 1 << 24;

/// Writes symbols as one long number (Martin 1979), most significant byte first.
///
/// The number so far is `bytes` followed by `low`. A carry out of `low` is added to the bytes at
/// once. Bytes that do not fit the buffer are counted but not stored, so that the length does not
/// depend on the buffer.
#[derive(Debug)]
pub(crate) struct RangeEncoder<'b> {
    low: u32,
    range: u32,
    bytes: &'b mut [u8],
    /// Number of bytes so far, including bytes that did not fit.
    length: usize,
    /// Number of bytes up to and including the last byte that is not 0.
    significant: usize,
    /// Number of bytes 0xff at the end of the number, which a carry would turn into 0.
    trailing_ones: usize,
}

impl<'b> RangeEncoder<'b> {
    pub(crate) fn new(bytes: &'b mut [u8]) -> Self {
        Self { low: 0, range: u32::MAX, bytes, length: 0, significant: 0, trailing_ones: 0 }
    }

    /// Writes a symbol with a probability of `frequencies.count / 2^bits`.
    #[inline(never)]
    pub(crate) fn put(&mut self, frequencies: Frequencies, bits: u32) {
        let unit = self.range >> bits;
        let (low, carries) = self.low.overflowing_add(unit * frequencies.start);
        self.low = low;
        if carries {
            self.carry();
        }
        self.range = unit * frequencies.count;
        while self.range < LEAST_RANGE {
            self.push_byte();
            self.range <<= 8;
        }
    }

    /// Writes a bit whose values are equally likely.
    #[inline]
    pub(crate) fn put_bit(&mut self, bit: bool) {
        let start = bit.into();
        self.put(Frequencies { start, count: 1 }, 1);
    }

    /// Writes the rest of the number. Several numbers decode to the same symbols; among the numbers
    /// with the most zero bytes at the end, the smallest is taken. These zero bytes are not
    /// written, because the decoder reads zeros after the last byte. A block of zeros, if its
    /// tables make zeros likely, therefore has no bytes.
    ///
    /// Returns the length in bytes. It is larger than the buffer if the bytes did not fit.
    pub(crate) fn finish(mut self) -> usize {
        let (low, end) = (u64::from(self.low), u64::from(self.low) + u64::from(self.range));
        let rounded_up = |zeros: u32| (low + (1 << zeros) - 1) >> zeros << zeros;
        // In one block out of five, the range contains a number that ends in four zero bytes. It
        // always contains a number that ends in three, because it is at least 2^24.
        let number = if rounded_up(32) < end { rounded_up(32) } else { rounded_up(24) };
        if number > u32::MAX.into() {
            self.carry();
        }
        #[expect(clippy::cast_possible_truncation, reason = "the carry is added already")]
        let low = number as u32;
        self.low = low;
        for _ in 0..4 {
            self.push_byte();
        }
        self.significant
    }

    /// Moves the most significant byte of `low` to the buffer.
    #[inline(always)]
    fn push_byte(&mut self) {
        let [top, ..] = self.low.to_be_bytes();
        if let Some(byte) = self.bytes.get_mut(self.length) {
            *byte = top;
        }
        self.length += 1;
        if top != 0 {
            self.significant = self.length;
        }
        self.trailing_ones = if top == u8::MAX { self.trailing_ones + 1 } else { 0 };
        self.low <<= 8;
    }

    /// Adds 1 to the number in `bytes`: the bytes 0xff at its end become 0, and the byte before
    /// them grows by 1. That byte cannot overflow, because the number stays within the range that
    /// the earlier symbols have left.
    fn carry(&mut self) {
        self.significant = self.length - self.trailing_ones;
        self.trailing_ones = 0;
        let kept = self.length.min(self.bytes.len());
        let (changed, zeros) = (self.significant.wrapping_sub(1), self.significant);
        if let Some(byte) = self.bytes.get_mut(changed) {
            *byte = byte.wrapping_add(1);
        }
        if let Some(zeros) = self.bytes.get_mut(zeros..kept) {
            zeros.fill(0);
        }
    }
}

/// Reads what [`RangeEncoder`] wrote. After the last byte it reads zeros.
#[derive(Clone, Debug)]
pub(crate) struct RangeDecoder<'b> {
    /// The number read so far, minus the start of the current range.
    offset: u32,
    range: u32,
    bytes: &'b [u8],
    /// Number of bytes read, including the zeros after the last byte.
    read: usize,
}

impl<'b> RangeDecoder<'b> {
    pub(crate) fn new(bytes: &'b [u8]) -> Self {
        let mut decoder = Self { offset: 0, range: u32::MAX, bytes, read: 0 };
        for _ in 0..4 {
            decoder.pull_byte();
        }
        decoder
    }

    /// Reads the next symbol. `starts` holds the first frequency of each symbol, ascending from 0;
    /// the frequencies of the last symbol end at 2^15.
    pub(crate) fn symbol(&mut self, starts: &[u16; MAGNITUDES]) -> usize {
        let unit = self.range >> FREQUENCY_BITS;
        let frequency = (self.offset / unit).min((1 << FREQUENCY_BITS) - 1);
        let symbol = starts.partition_point(|&start| u32::from(start) <= frequency);
        let symbol = symbol.saturating_sub(1);
        self.consume(unit, Frequencies::of_magnitude(starts, symbol));
        symbol
    }

    /// Reads a bit whose values are equally likely.
    pub(crate) fn bit(&mut self) -> bool {
        let unit = self.range >> 1;
        let bit = self.offset >= unit;
        let start = bit.into();
        self.consume(unit, Frequencies { start, count: 1 });
        bit
    }

    /// Returns true if some bytes were not needed to decode the symbols read so far.
    pub(crate) fn has_unread_bytes(&self) -> bool {
        self.read < self.bytes.len()
    }

    fn consume(&mut self, unit: u32, frequencies: Frequencies) {
        // If no encoder wrote the bytes, the offset can exceed the range; the subtraction then
        // wraps.
        self.offset = self.offset.wrapping_sub(unit.wrapping_mul(frequencies.start));
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes symbols whose ranges all contain one half, so that the bytes are 0x7f, 0xff, 0xff ..,
    /// and then a symbol above one half, whose carry turns the bytes into 0x80, 0, 0 .. Returns the
    /// length.
    fn write_one_half(symbols: usize, bytes: &mut [u8]) -> usize {
        let mut encoder = RangeEncoder::new(bytes);
        for _ in 0..symbols {
            // Before a byte is written, one half corresponds to the top bit of `low`. Afterwards,
            // one half is one more than the largest `low`, which wraps to 0.
            let half = if encoder.length == 0 { 1_u32 << 31 } else { 0 };
            let to_half = half.wrapping_sub(encoder.low);
            let unit = encoder.range >> FREQUENCY_BITS;
            let start = (to_half / unit).min((1 << FREQUENCY_BITS) - 2);
            encoder.put(Frequencies { start, count: 2 }, FREQUENCY_BITS);
        }
        let last = (1 << FREQUENCY_BITS) - 1;
        let frequencies = Frequencies { start: last, count: 1 };
        encoder.put(frequencies, FREQUENCY_BITS);
        encoder.finish()
    }

    #[test]
    fn the_length_does_not_depend_on_the_buffer() {
        for symbols in 1..12 {
            let mut bytes = [0xaa; 40];
            let length = write_one_half(symbols, &mut bytes);
            assert_eq!(bytes[0], 0x80, "the carry came");
            for kept in 0..length + 2 {
                let mut short = [0xaa; 40];
                assert_eq!(write_one_half(symbols, &mut short[..kept]), length, "{kept}");
                assert!(short[kept..].iter().all(|&byte| byte == 0xaa));
                let same = kept.min(length);
                assert_eq!(short[..same], bytes[..same], "{kept}");
            }
        }
    }
}
