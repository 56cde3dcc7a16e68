//! Failures that a test can cause in a running firmware image.

use crate::image::{Image, LOOP};

/// A failure that a test can cause. Causing it changes core registers and unused memory, but not
/// the image's code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Injection {
    /// The firmware runs into an endless loop.
    Hang,
    /// The firmware panics; the panic names the source location `injected.rs:7:3`.
    Panic,
    /// The firmware jumps to an unmapped address.
    HardFault,
    /// The stack pointer points outside the stack, and the firmware jumps to an unmapped address.
    WildStack,
    /// The stack pointer is 16 bytes above the lowest stack address, so the stack soon overflows.
    StackOverflow,
}

/// Values to write to the core's registers and its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Change {
    /// Number and new value of each register: 0 to 12 are r0 to r12, 13 is sp, 15 is pc.
    pub(crate) registers: Vec<(usize, u32)>,
    /// Address and contents of each range of bytes to write.
    pub(crate) memory: Vec<(u64, Vec<u8>)>,
}

/// Offset in bytes of unused memory within the memory that keeps the failure record across a reset.
const SPARE: u64 = 0x300;

const SP: usize = 13;
const PC: usize = 15;

impl Injection {
    /// Returns the changes that cause this failure; `None` if the image lacks symbols or code that
    /// they need.
    pub(crate) fn change(self, image: &Image) -> Option<Change> {
        let mut change = Change::default();
        match self {
            Self::Hang => change.registers.push((PC, word(image.find_instruction(LOOP)?))),
            Self::HardFault => change.registers.push((PC, 0x5FFF_FF00)),
            Self::WildStack => {
                // Let the stack pointer point into the unused memory after the failure record.
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
                // Layout of `core::panic::Location`: pointer and length of the file name, line,
                // column.
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

/// Returns an address as the 32-bit value of a register.
fn word(address: u64) -> u32 {
    u32::try_from(address).unwrap_or(u32::MAX)
}
