//! Reads the cause of the last reset, maps the boot loader's memory to address 0, and stops the
//! watchdog while a debugger halts the core.

use embassy_stm32::pac::{DBGMCU, RCC, SYSCFG};
use link::ResetCause;

/// Returns the cause of the last reset and clears the reset flags (RM0390 and RM0090, RCC_CSR). One
/// reset can set several flags: a reset by the watchdog or by software also sets the reset pin's
/// flag, and power-on also sets the brown-out flag. The more specific flag is therefore tested
/// first.
pub fn take_cause() -> ResetCause {
    let flags = RCC.csr().read();
    RCC.csr().modify(|flags| flags.set_rmvf(true));
    if flags.porrstf() {
        ResetCause::PowerOn
    } else if flags.wdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.borrstf() {
        ResetCause::BrownOut
    } else if flags.padrstf() {
        ResetCause::Pin
    } else {
        ResetCause::NotKnown
    }
}

/// Maps the system memory, which contains the chip's boot loader, to address 0, as the loader
/// expects (RM0390, SYSCFG_MEMRMP).
pub fn map_system_memory() {
    RCC.apb2enr().modify(|enable| enable.set_syscfgen(true));
    // The clock of SYSCFG starts with a delay; a read of the clock enable register waits until the
    // clock runs.
    let _ = RCC.apb2enr().read();
    SYSCFG.memrm().modify(|map| map.set_mem_mode(0b001));
}

/// Stops the watchdog's counter while a debugger halts the core.
pub fn freeze_watchdog_in_debug() {
    DBGMCU.apb1fzr().modify(|freeze| freeze.set_iwdg(true));
}
