//! Failures that are made to happen in an image that would not fail by itself.

use crate::Image;
use crate::image::LOOP;

/// A failure. The image's code stays as it is: the core's registers are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Injection {
    /// A loop without end.
    Hang,
    /// A panic at `injected.rs:7:3`.
    Panic,
    /// A jump to where nothing is.
    HardFault,
    /// A stack pointer among the variables, and a jump to where nothing is.
    WildStack,
    /// A stack with 16 bytes left.
    StackOverflow,
}

/// What the core and its memory are to be set to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Change {
    /// Number and value: r0 to r12, sp 13, pc 15.
    pub(crate) registers: Vec<(usize, u32)>,
    /// Address and bytes.
    pub(crate) memory: Vec<(u64, Vec<u8>)>,
}

/// Memory after the record of a failure, which nothing uses, from the beginning of its region on.
const SPARE: u64 = 0x300;

const SP: usize = 13;
const PC: usize = 15;

impl Injection {
    /// How an image comes to fail so; none where it has no code that could.
    pub(crate) fn change(self, image: &Image) -> Option<Change> {
        let mut change = Change::default();
        match self {
            Self::Hang => change.registers.push((PC, word(image.instruction(LOOP)?))),
            Self::HardFault => change.registers.push((PC, 0x5FFF_FF00)),
            Self::WildStack => {
                // The memory of the failure's record and after it: nothing there is in use.
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
                // core::panic::Location: file, line, column.
                let location = [word(spare) + 16, 11, 7, 3];
                let mut bytes = location.map(u32::to_le_bytes).concat();
                bytes.extend(file);
                change.memory.push((spare, bytes));
                let (panic, register) = image.panic()?;
                change.registers.push((register, word(spare)));
                change.registers.push((PC, word(panic)));
            }
        }
        Some(change)
    }
}

/// The lower half, which is all that an address has.
fn word(address: u64) -> u32 {
    u32::try_from(address).unwrap_or(u32::MAX)
}
