//! What the emulator may notice without a fault of the firmware, each with the reason.

use crate::{Findings, Model};

/// A finding that is allowed: its beginning, and why.
type Reason = (&'static str, &'static str);

/// Of the STM32H743.
const H743: &[Reason] = &[
    (
        "RCC.BDCR: RM0433 rev 9 8.7.26 bits 9:8: RTCSEL",
        "embassy writes RTCSEL, which is set to its reset value; the RTC is not used",
    ),
    (
        "RCC.CFGR: DS12110 rev 11 table 112",
        "480 MHz needs scale 0, which SYSCFG's ODEN switches on; the emulator has no ODEN",
    ),
    (
        "RCC.D1CFGR: DS12110 rev 11 table 112",
        "as for CFGR: the bus clocks of scale 0",
    ),
    (
        "RCC.D2CFGR: DS12110 rev 11 table 112",
        "as for CFGR: the bus clocks of scale 0",
    ),
    (
        "RCC.PLLCKSELR: RM0433 rev 9 8.5.5",
        "embassy sets the divider of one PLL while the other runs, to what it is already",
    ),
];

/// Of the STM32F446, which the emulator's STM32F427 stands in for.
const F446: &[Reason] = &[
    (
        "SYSCFG.EXTICR",
        "a register that keeps what is written; the model of EXTI reads it",
    ),
    (
        "SYSCFG.MEMRM",
        "shows the loader's memory at address 0 on the chip; the core reads its vectors where they are",
    ),
];

/// What is not on the list.
pub fn surprises(model: Model, findings: &Findings) -> Vec<String> {
    let list = match model {
        Model::H743 => H743,
        Model::F446 => F446,
    };
    let is_allowed = |finding: &&String| list.iter().any(|(begin, _)| finding.starts_with(begin));
    let all = [&findings.told, &findings.unimplemented, &findings.undefined];
    let all = all.into_iter().flatten();
    all.filter(|finding| !is_allowed(finding))
        .cloned()
        .collect()
}
