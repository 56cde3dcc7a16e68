//! A range encoder with a range of 32 bits.

use crate::tables::Frequencies;

/// The range is at least this large between two symbols.
const LEAST_RANGE: u32 = 1 << 24;

/// Writes symbols as one number of as many bytes as needed (Martin 1979), most significant byte first.
///
/// The number so far is `bytes` followed by `low`. A carry out of `low` is added to the bytes at once. Bytes
/// that do not fit the buffer are counted and not kept.
#[derive(Debug)]
pub(crate) struct RangeEncoder<'b> {
    low: u32,
    range: u32,
    bytes: &'b mut [u8],
    /// Number of bytes so far, those that did not fit included.
    length: usize,
    /// Number of bytes up to the last one that is not 0.
    significant: usize,
}

impl<'b> RangeEncoder<'b> {
    pub(crate) fn new(bytes: &'b mut [u8]) -> Self {
        Self {
            low: 0,
            range: u32::MAX,
            bytes,
            length: 0,
            significant: 0,
        }
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

    /// Writes a bit that is as likely as not.
    #[inline]
    pub(crate) fn put_bit(&mut self, bit: bool) {
        let start = bit.into();
        self.put(Frequencies { start, count: 1 }, 1);
    }

    /// Ends the number: of all numbers that mean the symbols, the smallest with the most zero bytes at its end,
    /// which are not written. A decoder reads zeros there. So a block of likely zeros has no byte at all.
    ///
    /// Returns the number of bytes. It is larger than the buffer if they did not fit.
    pub(crate) fn finish(mut self) -> usize {
        let (low, end) = (
            u64::from(self.low),
            u64::from(self.low) + u64::from(self.range),
        );
        let mut number = low;
        for zeros in [24, 16, 8] {
            let rounded = (low + (1 << zeros) - 1) >> zeros << zeros;
            if rounded < end {
                number = rounded;
                break;
            }
        }
        if number > u32::MAX.into() {
            self.carry();
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the carry is added already"
        )]
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
        self.low <<= 8;
    }

    /// Adds 1 to the bytes.
    fn carry(&mut self) {
        let Some(bytes) = self.bytes.get_mut(..self.length) else {
            // The last byte, which was not kept, is no longer 0, unless the number is too long anyway.
            self.significant = self.length;
            return;
        };
        let last = bytes.len();
        for (index, byte) in bytes.iter_mut().rev().enumerate() {
            *byte = byte.wrapping_add(1);
            if *byte != 0 {
                self.significant = last - index;
                return;
            }
        }
    }
}
