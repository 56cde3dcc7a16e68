//! How deep the stack has been.
#![expect(unsafe_code, reason = "reads memory below the stack pointer")]

/// What cortex-m-rt's feature `paint-stack` fills the stack with at start-up.
const PAINT: u32 = 0xCCCC_CCCC;

/// The stack of all tasks and interrupts, from its symbols in the board's memory map.
#[derive(Clone, Copy, Debug)]
pub struct Stack {
    /// Lowest address, a multiple of 4.
    end: usize,
    /// Behind the highest one.
    start: usize,
}

impl Stack {
    /// The stack between two addresses.
    ///
    /// # Safety
    /// All words in between are readable memory that cortex-m-rt has painted, and nothing but the
    /// stack writes to them.
    pub const unsafe fn between(end: usize, start: usize) -> Self {
        Self { end, start }
    }

    /// Bytes that it has.
    pub const fn size(self) -> usize {
        self.start - self.end
    }

    /// Returns whether `words` words that start at `address` are aligned and all within the stack, so that
    /// a fault handler may read them.
    pub const fn contains_words(self, address: usize, words: usize) -> bool {
        address.is_multiple_of(size_of::<u32>())
            && address >= self.end
            && address <= self.start
            && words <= (self.start - address) / size_of::<u32>()
    }

    /// Bytes that were used at most since boot: what lies above the lowest word that is no paint. It
    /// reads as many words as were never used: not for a task with a short deadline.
    pub fn used(self) -> usize {
        let words = (self.end..self.start).step_by(size_of::<u32>());
        let untouched = words.take_while(|&word| {
            // SAFETY: `between` has promised it. Volatile, because the stack is in use.
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
    fn words_are_in_the_stack_only_with_all_of_them_and_aligned() {
        // SAFETY: nothing reads it.
        let stack = unsafe { Stack::between(0x2000_0000, 0x2000_8000) };
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
