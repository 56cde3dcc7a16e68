//! Reads the cause of the last reset, and stops the watchdog while a debugger halts the core.

use embassy_stm32::pac::{DBGMCU, RCC};
use link::ResetCause;

/// Returns the cause of the last reset and clears the reset flags (RM0433, RCC_RSR). One reset can
/// set several flags: a reset by the watchdog or by software also sets the reset pin's flag, and
/// power-on also sets the brown-out flag. The more specific flag is therefore tested first.
pub(crate) fn take_cause() -> ResetCause {
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

/// Stops the watchdog's counter while a debugger halts the core.
pub(crate) fn freeze_watchdog_in_debug() {
    DBGMCU.apb4fzr1().modify(|freeze| freeze.set_iwdg1(true));
}
