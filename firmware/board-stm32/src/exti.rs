//! External interrupts of the pins (EXTI).
#![expect(unsafe_code, reason = "an interrupt is enabled")]

use embassy_stm32::{
    interrupt::{self, InterruptExt},
    pac::{EXTI, exti::regs::Lines},
};

/// Disables the interrupts of all pins.
///
/// embassy's feature `exti`, which [`ExtiInput`](embassy_stm32::exti::ExtiInput) needs, enables all
/// these interrupts when it initialises the chip: at the highest priority, and even those that have
/// no handler. Until this call, only EXTI's mask register (IMR) blocks them; after a reset it is
/// zero for all pins. Later, [`interrupts::init`](crate::interrupts::init) enables DRDY's
/// interrupt, and [`enable_trigger`] the trigger's.
pub(crate) fn disable_all() {
    for line in [
        interrupt::EXTI0,
        interrupt::EXTI1,
        interrupt::EXTI2,
        interrupt::EXTI3,
        interrupt::EXTI4,
        interrupt::EXTI9_5,
        interrupt::EXTI15_10,
    ] {
        line.disable();
    }
}

/// Clears the pending bits of `lines`, so that an edge runs the handler only once.
pub(crate) fn clear_pending(lines: u32) {
    EXTI.pr(0).write_value(Lines(lines));
    // The write is posted: if the handler returned before the write takes effect, it would run
    // again and count an edge that did not happen. A read from the same peripheral waits for the
    // write.
    let _ = EXTI.pr(0).read();
}

/// Enables the trigger's interrupt. If an edge is pending, the handler runs at once.
pub(crate) fn enable_trigger() {
    // SAFETY: the module `interrupts` has the trigger's handler, and no critical section relies on
    // this interrupt being disabled.
    unsafe { interrupt::EXTI15_10.enable() };
}

/// Disables the trigger's interrupt. An edge that occurs while it is disabled stays pending.
pub(crate) fn disable_trigger() {
    interrupt::EXTI15_10.disable();
}
