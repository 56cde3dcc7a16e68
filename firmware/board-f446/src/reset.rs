//! Why the chip has started.

use embassy_stm32::pac::{DBGMCU, RCC, SYSCFG};
use link::ResetCause;

/// Reads the cause and clears it for the next time (RM0390, RCC_CSR). A watchdog and software pull the reset
/// pin too, and a supply that comes up is low before: the first that applies is the cause.
pub(crate) fn cause() -> ResetCause {
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

/// Shows the system memory where the core looks for its vectors (RM0390, SYSCFG_MEMRMP), as its loader wants it.
pub(crate) fn map_system_memory() {
    RCC.apb2enr().modify(|enable| enable.set_syscfgen(true));
    // The clock runs a little later; a read from the register waits for it.
    let _ = RCC.apb2enr().read();
    SYSCFG.memrm().modify(|map| map.set_mem_mode(0b001));
}

/// Lets the watchdog wait while a debugger holds the core.
pub(crate) fn spare_the_debugger() {
    DBGMCU.apb1fzr().modify(|freeze| freeze.set_iwdg(true));
}
