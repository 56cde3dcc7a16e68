//! Bits appended to bytes.

/// Writes bits to bytes, most significant bit first.
///
/// Bits without room are discarded: [`finish`](Self::finish) then returns `None`.
#[derive(Debug)]
pub(crate) struct BitWriter<'b> {
    room: core::slice::IterMut<'b, [u8; 4]>,
    /// Bits that are not written yet, at the top.
    pending: u32,
    /// Unused bits of `pending`, 1 to 32.
    free: u32,
    /// Number of whole words that `room` had at first.
    capacity: usize,
    /// True if bits were discarded.
    is_full: bool,
}

impl<'b> BitWriter<'b> {
    /// Creates a writer into the whole words of `room`.
    #[inline]
    pub(crate) fn new(room: &'b mut [u8]) -> Self {
        let (words, _) = room.as_chunks_mut();
        Self {
            capacity: words.len(),
            room: words.iter_mut(),
            pending: 0,
            free: 32,
            is_full: false,
        }
    }

    /// Appends the lowest `width` bits of `bits`, whose other bits must be 0; `width` is 1 to 32.
    #[inline]
    pub(crate) fn put(&mut self, bits: u32, width: u32) {
        if width < self.free {
            self.free -= width;
            self.pending |= bits << self.free;
        } else {
            let spilled = width - self.free;
            self.write(self.pending | (bits >> spilled));
            self.free = 32 - spilled;
            // In two steps, because `free` can be 32.
            self.pending = (bits << (self.free - 1)) << 1;
        }
    }

    #[inline]
    fn write(&mut self, word: u32) {
        match self.room.next() {
            Some(place) => *place = word.to_be_bytes(),
            None => self.is_full = true,
        }
    }

    /// Writes the remaining bits and returns the number of bytes; `None` if the bits did not fit.
    pub(crate) fn finish(mut self) -> Option<usize> {
        let whole = self.capacity - self.room.len();
        let rest = (32 - self.free).div_ceil(8);
        if rest > 0 {
            self.write(self.pending);
        }
        (!self.is_full).then_some(whole * 4 + rest as usize)
    }
}
