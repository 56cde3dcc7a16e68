//! Collection of the problems that the emulator detects in a session.

use rigless::session::Session;

use crate::board::Nucleo;

/// Problems that the emulator has detected since power-on, one text for each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Accesses to addresses at which the chip has nothing.
    pub unmapped: Vec<String>,
    /// Accesses that the bus refused, for example to a peripheral without a clock or with a wrong width.
    pub refused: Vec<String>,
    /// Accessed registers that no model implements: they store the written value and have no effect.
    pub unimplemented: Vec<String>,
    /// Accesses to reserved addresses within a peripheral.
    pub undefined: Vec<String>,
    /// Interrupts that were raised but are not connected to the NVIC.
    pub unrouted: Vec<String>,
    /// Violations of the reference manual: the register, and the violated rule with its section.
    pub manual_violations: Vec<String>,
    /// Resets: the time in us since power-on, and the cause.
    pub resets: Vec<(u64, String)>,
}

impl Findings {
    pub(crate) fn from_session(session: &Session<Nucleo>) -> Self {
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
            manual_violations: session
                .told()
                .map(|violation| {
                    format!(
                        "{}.{}: {}",
                        violation.instance, violation.register, violation.reason
                    )
                })
                .collect(),
            resets: session
                .resets()
                .iter()
                .map(|reset| (reset.at.0 / 1000, format!("{:?}", reset.cause)))
                .collect(),
        }
    }
}
