//! Bits taken from bytes.

/// Reads bits from bytes, most significant bit first.
#[derive(Debug)]
pub(crate) struct BitReader<'b> {
    bytes: &'b [u8],
    /// Bits that are not read yet, at the top.
    pending: u64,
    /// Number of bits in `pending`.
    held: u32,
}

impl<'b> BitReader<'b> {
    pub(crate) const fn new(bytes: &'b [u8]) -> Self {
        Self {
            bytes,
            pending: 0,
            held: 0,
        }
    }

    /// Takes the next `width` bits, 0 to 32; `None` if there are fewer.
    pub(crate) fn take(&mut self, width: u32) -> Option<u32> {
        self.fill();
        self.held = self.held.checked_sub(width)?;
        // In two steps, because `width` can be 0.
        let bits = (self.pending >> 1) >> (63 - width);
        self.pending <<= width;
        u32::try_from(bits).ok()
    }

    /// Takes the zeros up to the next one, and that one; returns their number. Takes at most `most`
    /// zeros, without a one after them. `None` if the bits end before.
    pub(crate) fn take_zeros(&mut self, most: u32) -> Option<u32> {
        self.fill();
        let zeros = self.pending.leading_zeros();
        let (zeros, width) = if zeros < most {
            (zeros, zeros + 1)
        } else {
            (most, most)
        };
        self.take(width)?;
        Some(zeros)
    }

    /// Returns true if fewer than 8 bits are left and these are 0.
    pub(crate) fn ends(mut self) -> bool {
        self.fill();
        self.held < 8 && self.pending == 0
    }

    /// Reads bytes until at least 57 bits are held, or none are left.
    fn fill(&mut self) {
        while self.held <= 56 {
            let Some((&byte, rest)) = self.bytes.split_first() else {
                return;
            };
            self.bytes = rest;
            self.pending |= u64::from(byte) << (56 - self.held);
            self.held += 8;
        }
    }
}
