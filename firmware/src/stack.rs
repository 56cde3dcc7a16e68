//! Bounds of the stack, and the largest number of its bytes that were in use since boot.
#![expect(unsafe_code, reason = "reads memory below the stack pointer")]

/// Word with which cortex-m-rt's feature `paint-stack` fills the unused stack at start-up.
const PAINT: u32 = 0xCCCC_CCCC;

/// Stack of all tasks and interrupts; it grows down from `start` to `end`.
#[derive(Clone, Copy, Debug)]
pub struct Stack {
    /// Lowest address of the stack, a multiple of 4.
    end: usize,
    /// One past the highest address of the stack.
    start: usize,
}

impl Stack {
    /// Describes the stack from `end`, its lowest address, up to but excluding `start`.
    ///
    /// # Safety
    /// All words from `end` up to `start` are readable memory that cortex-m-rt has painted, and
    /// only the stack writes to them.
    pub const unsafe fn from_bounds(end: usize, start: usize) -> Self {
        Self { end, start }
    }

    /// Returns the size of the whole stack in bytes.
    pub const fn size(self) -> usize {
        self.start - self.end
    }

    /// Returns whether `words` words from `address` are aligned and within the stack, so that a
    /// fault handler may read them.
    pub const fn contains_words(self, address: usize, words: usize) -> bool {
        address.is_multiple_of(size_of::<u32>())
            && address >= self.end
            && address <= self.start
            && words <= (self.start - address) / size_of::<u32>()
    }

    /// Returns the largest number of stack bytes in use since boot: from the lowest word that is
    /// not `PAINT` up to the start of the stack. Reads every word that was never used, which takes
    /// too long for a task with a short deadline.
    pub fn peak_bytes(self) -> usize {
        let words = (self.end..self.start).step_by(size_of::<u32>());
        let untouched = words.take_while(|&word| {
            // SAFETY: the caller of `from_bounds` guarantees that all words of the stack are
            // readable. Volatile, because tasks and interrupts write to the stack meanwhile.
            let value = unsafe { (word as *const u32).read_volatile() };
            value == PAINT
        });
        self.size() - size_of::<u32>() * untouched.count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stack_contains_words_only_if_aligned_and_entirely_inside() {
        // SAFETY: the test reads none of this memory.
        let stack = unsafe { Stack::from_bounds(0x2000_0000, 0x2000_8000) };
        for (address, is_inside) in [
            (0x2000_0000, true),
            (0x2000_7fe0, true),
            (0x2000_7fe4, false),
            (0x2000_8000, false),
            (0x1fff_fffc, false),
            (0x2000_0002, false),
            (0x3000_0000, false),
            (0, false),
            (usize::MAX - 3, false),
        ] {
            assert_eq!(stack.contains_words(address, 8), is_inside, "{address:#x}");
        }
        assert!(stack.contains_words(0x2000_8000, 0));
        assert!(!stack.contains_words(0x2000_0000, usize::MAX));
    }
}
