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
