//! Failures that a test injects into a running image.

use crate::image::{Image, LOOP};

/// Failure that a test injects. The injection changes registers and unused memory, not the code of
/// the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Injection {
    /// An endless loop.
    Hang,
    /// A panic at `injected.rs:7:3`.
    Panic,
    /// A jump to an unmapped address.
    HardFault,
    /// A stack pointer outside the stack, and a jump to an unmapped address.
    WildStack,
    /// A stack pointer 16 bytes above the lowest address of the stack, so the stack soon overflows.
    StackOverflow,
}

/// Values to set in the core and its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Change {
    /// Register number and value: 0 to 12 are r0 to r12, 13 is sp, 15 is pc.
    pub(crate) registers: Vec<(usize, u32)>,
    /// First address, and the bytes to write there.
    pub(crate) memory: Vec<(u64, Vec<u8>)>,
}

/// Offset in bytes of memory that the firmware does not use, from the start of the region that
/// keeps the failure record across a reset.
const SPARE: u64 = 0x300;

const SP: usize = 13;
const PC: usize = 15;

impl Injection {
    /// Returns the changes that cause this failure; `None` if the image lacks a symbol or code that
    /// they need.
    pub(crate) fn change(self, image: &Image) -> Option<Change> {
        let mut change = Change::default();
        match self {
            Self::Hang => change
                .registers
                .push((PC, word(image.find_instruction(LOOP)?))),
            Self::HardFault => change.registers.push((PC, 0x5FFF_FF00)),
            Self::WildStack => {
                // Unused memory after the failure record.
                let spare = word(image.address("_kept")? + SPARE + 0xF0);
                change.registers.extend([(SP, spare), (PC, 0x5FFF_FF00)]);
            }
            Self::StackOverflow => {
                let end = word(image.address("_stack_end")?);
                change.registers.push((SP, end + 16));
            }
            Self::Panic => {
                let spare = image.address("_kept")? + SPARE;
                let file = b"injected.rs";
                // Layout of core::panic::Location: file (pointer, length), line, column.
                let location = [word(spare) + 16, 11, 7, 3];
                let mut bytes = location.map(u32::to_le_bytes).concat();
                bytes.extend(file);
                change.memory.push((spare, bytes));
                let (function, register) = image.panic_function()?;
                change.registers.push((register, word(spare)));
                change.registers.push((PC, word(function)));
            }
        }
        Some(change)
    }
}

/// Converts an address to 32 bits.
fn word(address: u64) -> u32 {
    u32::try_from(address).unwrap_or(u32::MAX)
}
