//! Findings that are not faults of the firmware, each with the reason.

use crate::findings::Findings;
use crate::model::Model;

/// Prefix of an allowed finding, and why it is allowed.
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
        "embassy rewrites the divider of one PLL, unchanged, while the other PLL runs",
    ),
];

/// Findings that are allowed on the STM32F446, which is emulated as an STM32F427.
const F446: &[Reason] = &[
    (
        "SYSCFG.EXTICR",
        "the register stores the written value, and the EXTI model here reads it",
    ),
    (
        "SYSCFG.MEMRM",
        "maps the boot loader to address 0 on the chip; the emulated core reads the vectors at their own address",
    ),
];

/// Returns the manual violations, unimplemented registers and undefined addresses in `findings` that are
/// not allowed for `model`. Other kinds of findings are ignored.
pub fn unexpected(model: Model, findings: &Findings) -> Vec<String> {
    let list = match model {
        Model::H743 => H743,
        Model::F446 => F446,
    };
    let is_allowed = |finding: &&String| list.iter().any(|(prefix, _)| finding.starts_with(prefix));
    let all = [
        &findings.manual_violations,
        &findings.unimplemented,
        &findings.undefined,
    ];
    let all = all.into_iter().flatten();
    all.filter(|finding| !is_allowed(finding))
        .cloned()
        .collect()
}
