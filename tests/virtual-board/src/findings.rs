//! What the emulator noticed about an image.

use rigless::session::Session;

use crate::board::Nucleo;

/// What the emulator noticed about an image, each in words, with the program counter where it has one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Accesses to addresses that nothing answers.
    pub unmapped: Vec<String>,
    /// Accesses that the bus refused: a peripheral without a clock, a wrong width.
    pub refused: Vec<String>,
    /// Registers that no model implements: they keep what is written and do nothing.
    pub unimplemented: Vec<String>,
    /// Accesses to reserved addresses within a peripheral.
    pub undefined: Vec<String>,
    /// Interrupts without a line.
    pub unrouted: Vec<String>,
    /// Breaches of the reference manual, with its section.
    pub told: Vec<String>,
    /// Resets: when, us, and what asked for them.
    pub resets: Vec<(u64, String)>,
}

impl Findings {
    pub(crate) fn of(session: &Session<Nucleo>) -> Self {
        let unmapped = session.unmapped().into_iter();
        Self {
            unmapped: unmapped
                .map(|gap| format!("{:#010x} from {:#010x}", gap.address, gap.program_counter))
                .collect(),
            refused: session
                .refused()
                .iter()
                .map(|(address, fault)| format!("{address:#010x}: {fault:?}"))
                .collect(),
            unimplemented: session
                .unimplemented()
                .values()
                .map(|register| format!("{}.{}", register.instance, register.register))
                .collect(),
            undefined: session
                .undefined()
                .iter()
                .map(|(address, gap)| format!("{}+{address:#010x}", gap.instance))
                .collect(),
            unrouted: session
                .unrouted()
                .iter()
                .map(|(instance, line)| format!("{instance} {line}"))
                .collect(),
            told: session
                .told()
                .map(|told| format!("{}.{}: {}", told.instance, told.register, told.reason))
                .collect(),
            resets: session
                .resets()
                .iter()
                .map(|reset| (reset.at.0 / 1000, format!("{:?}", reset.cause)))
                .collect(),
        }
    }
}
