//! Ticks of the processor's clock: cycles on a board, periods of a 25 MHz clock on QEMU's MPS2
//! boards.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_rt::exception;

/// Value from which SysTick, a timer of 24 bits, counts down to 0 (ARMv7-M Architecture Reference
/// Manual, B3.3).
const RELOAD: u32 = 0x00ff_ffff;

/// Number of times that SysTick has reached 0.
static ENDS: AtomicU32 = AtomicU32::new(0);

/// Starts SysTick. The cycle counter of the DWT has 32 bits, but QEMU does not emulate it.
pub(crate) fn start(timer: &mut SYST) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(RELOAD);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

/// Returns the ticks since [`start`].
pub(crate) fn ticks() -> u64 {
    loop {
        let ends = ENDS.load(Relaxed);
        let left = SYST::get_current();
        if ends == ENDS.load(Relaxed) {
            let period = u64::from(RELOAD) + 1;
            return u64::from(ends) * period + u64::from(RELOAD - left);
        }
    }
}

#[exception]
fn SysTick() {
    ENDS.fetch_add(1, Relaxed);
}
