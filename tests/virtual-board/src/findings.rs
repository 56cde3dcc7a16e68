//! Problems that the emulator detects, the list of allowed ones with their reasons, and the error
//! type of virtual boards.

use std::fmt;

use rigless::session::Session;

use crate::board::EmulatedBoard;
use crate::model::Model;

/// Problems that the emulator has detected since power-on, with one text for each problem.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Accesses to addresses at which the chip has no memory or peripheral.
    pub unmapped: Vec<String>,
    /// Accesses that the bus refused, for example because the peripheral has no clock or the access
    /// has a wrong width.
    pub refused: Vec<String>,
    /// Accessed registers that the emulator does not model: they store what is written and have no
    /// effect.
    pub unimplemented: Vec<String>,
    /// Accesses to reserved addresses within the address block of a peripheral.
    pub undefined: Vec<String>,
    /// Interrupts that a peripheral raised but that are not connected to the NVIC.
    pub unrouted: Vec<String>,
    /// Violations of the reference manual: the register, the violated rule and the rule's section.
    pub manual_violations: Vec<String>,
    /// Resets of the chip: time in us since power-on, and cause.
    pub resets: Vec<(u64, String)>,
}

impl Findings {
    pub(crate) fn from_session(session: &Session<EmulatedBoard>) -> Self {
        Self {
            unmapped: texts(session.unmapped(), |gap| {
                format!("{:#010x} from {:#010x}", gap.address, gap.program_counter)
            }),
            refused: texts(session.refused(), |(address, fault)| {
                format!("{address:#010x}: {fault:?}")
            }),
            unimplemented: texts(session.unimplemented().values(), |register| {
                format!("{}.{}", register.instance, register.register)
            }),
            undefined: texts(session.undefined(), |(address, gap)| {
                format!("{}+{address:#010x}", gap.instance)
            }),
            unrouted: texts(session.unrouted(), |(instance, line)| format!("{instance} {line}")),
            manual_violations: texts(session.told(), |told| {
                format!("{}.{}: {}", told.instance, told.register, told.reason)
            }),
            resets: session
                .resets()
                .iter()
                .map(|reset| (reset.at.0 / 1000, format!("{:?}", reset.cause)))
                .collect(),
        }
    }

    /// Returns those violations of the manual, unimplemented registers and undefined addresses that
    /// are not allowed for the board `model`. Ignores findings of other kinds.
    pub fn unexpected(&self, model: Model) -> Vec<String> {
        let list = match model {
            Model::H743 => H743,
            Model::F446 | Model::Ironbci => F4,
        };
        let is_allowed =
            |finding: &&String| list.iter().any(|(prefix, _)| finding.starts_with(prefix));
        let all = [&self.manual_violations, &self.unimplemented, &self.undefined];
        let all = all.into_iter().flatten();
        all.filter(|finding| !is_allowed(finding)).cloned().collect()
    }
}

fn texts<T>(items: impl IntoIterator<Item = T>, text: impl Fn(T) -> String) -> Vec<String> {
    items.into_iter().map(text).collect()
}

/// First part of the text of an allowed finding, and the reason why it is allowed.
type Reason = (&'static str, &'static str);

/// Findings that are allowed on the STM32H743.
const H743: &[Reason] = &[
    (
        "RCC.BDCR: RM0433 rev 9 8.7.26 bits 9:8: RTCSEL",
        "embassy writes the reset value to RTCSEL; the RTC is not used",
    ),
    (
        "RCC.CFGR: DS12110 rev 11 table 112",
        "480 MHz needs voltage scale 0, which ODEN in SYSCFG enables; the emulator does not model ODEN",
    ),
    ("RCC.D1CFGR: DS12110 rev 11 table 112", "as for CFGR: the bus clocks of scale 0"),
    ("RCC.D2CFGR: DS12110 rev 11 table 112", "as for CFGR: the bus clocks of scale 0"),
    (
        "RCC.PLLCFGR: RM0433 rev 9 8.5.5, 8.7.12: PLLxRGE",
        "8 MHz are the border of two ranges, and those of an RC oscillator can be below it",
    ),
    (
        "RCC.PLLCKSELR: RM0433 rev 9 8.5.5",
        "embassy rewrites the divider of one PLL, unchanged, while the other PLL runs",
    ),
];

/// Findings that are allowed on the STM32F446 and the STM32F407, which the emulator runs as an
/// STM32F427.
const F4: &[Reason] = &[
    ("SYSCFG.EXTICR", "the register stores the written value, and the EXTI model here reads it"),
    (
        "SYSCFG.MEMRM",
        "maps the boot loader to address 0 on the chip; the emulated core reads the vectors at their own address",
    ),
];

/// Largest number of lines that a section of a snapshot shows; earlier lines are left out.
const LINES: usize = 16;

/// Error of a virtual board, with a description of the board's state when the error occurred.
#[derive(Clone, thiserror::Error)]
#[error("{what}\n{snapshot}")]
pub struct BoardError {
    what: String,
    snapshot: String,
}

impl BoardError {
    pub(crate) fn new(what: String, snapshot: String) -> Self {
        Self { what, snapshot }
    }
}

// `Debug` prints the same text as `Display`, because Rust prints the error that a test returns with
// `Debug`.
impl fmt::Debug for BoardError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{self}")
    }
}

/// Returns a section of a snapshot: its title and the last [`LINES`] of `lines`; empty if none.
pub(crate) fn section(title: &str, lines: &[String]) -> String {
    let last = &lines[lines.len().saturating_sub(LINES)..];
    let title = (!last.is_empty()).then(|| format!("  {title}:\n"));
    let lines = last.iter().map(|line| format!("    {line}\n"));
    title.into_iter().chain(lines).collect()
}
