//! Why the chip has started.

use embassy_stm32::pac::{DBGMCU, RCC};
use link::ResetCause;

/// Reads the cause and clears it for the next time (RM0433, RCC_RSR). A watchdog and software pull the reset
/// pin too, and a supply that comes up is low before: the first that applies is the cause.
pub(crate) fn cause() -> ResetCause {
    let flags = RCC.rsr().read();
    RCC.rsr().modify(|flags| flags.set_rmvf(true));
    if flags.porrstf() {
        ResetCause::PowerOn
    } else if flags.iwdg1rstf() || flags.wwdg1rstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.borrstf() {
        ResetCause::BrownOut
    } else if flags.pinrstf() {
        ResetCause::Pin
    } else {
        ResetCause::NotKnown
    }
}

/// Lets the watchdog wait while a debugger holds the core.
pub(crate) fn spare_the_debugger() {
    DBGMCU.apb4fzr1().modify(|freeze| freeze.set_iwdg1(true));
}
