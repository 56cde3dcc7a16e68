//! Which interrupt does what, and how urgent it is.
#![expect(unsafe_code, reason = "an executor is run by its own interrupt alone")]

use embassy_executor::InterruptExecutor;
use embassy_stm32::{
    interrupt::{self, InterruptExt, Priority},
    pac::{EXTI, exti::regs::Lines},
};
use firmware::deadlines::priority;

use crate::{drdy, trigger};

pub(crate) static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static CONVERSE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static ENCODE: InterruptExecutor = InterruptExecutor::new();

/// A level of [`priority`] as the chip has it: its upper 4 bits.
pub fn prioritise(level: u8) -> Priority {
    Priority::from(level << 4)
}

/// Disables the interrupts of all pins, for a start.
///
/// embassy's feature `exti`, which [`ExtiInput`](embassy_stm32::exti::ExtiInput) is part of, enables them
/// all when the chip is initialised, at the highest priority and whether they have a handler or not. Until
/// then only EXTI's mask (IMR), which is zero for all pins after a reset, keeps them silent. DRDY's is enabled
/// by [`begin`] and the trigger's by [`listen_to_trigger`]; the others stay disabled and masked.
pub(crate) fn silence_pins() {
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

/// Gives each interrupt its priority; a peripheral that only one board uses gets its own from there.
pub(crate) fn begin() {
    interrupt::EXTI9_5.set_priority(prioritise(priority::DRDY));
    interrupt::EXTI15_10.set_priority(prioritise(priority::TRIGGER));
    interrupt::TIM2.set_priority(prioritise(priority::TIME));
    interrupt::OTG_FS.set_priority(prioritise(priority::CONVERSE));
    interrupt::UART4.set_priority(prioritise(priority::ACQUIRE));
    interrupt::UART5.set_priority(prioritise(priority::CONVERSE));
    interrupt::SAI1.set_priority(prioritise(priority::ENCODE));
    // SAFETY: no critical section is open, and its handler is below.
    unsafe { interrupt::EXTI9_5.enable() };
}

/// Clears pending bits of EXTI's lines, so that their interrupt does not come twice for one edge.
pub(crate) fn acknowledge(lines: u32) {
    EXTI.pr(0).write_value(Lines(lines));
    // The write is posted: a handler that returns before it has arrived is entered again, and would
    // count an edge that did not happen. A read from the same peripheral waits for it.
    let _ = EXTI.pr(0).read();
}

/// From now on the trigger's edges are looked at, one that waits first.
pub(crate) fn listen_to_trigger() {
    // SAFETY: its handler is below, and no critical section relies on its silence.
    unsafe { interrupt::EXTI15_10.enable() };
}

#[embassy_stm32::interrupt]
fn EXTI9_5() {
    drdy::edge();
}

#[embassy_stm32::interrupt]
fn EXTI15_10() {
    trigger::edge();
}

/// A spare interrupt.
#[embassy_stm32::interrupt]
unsafe fn UART4() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { ACQUIRE.on_interrupt() }
}

/// A spare interrupt.
#[embassy_stm32::interrupt]
unsafe fn UART5() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { CONVERSE.on_interrupt() }
}

/// A spare interrupt.
#[embassy_stm32::interrupt]
unsafe fn SAI1() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { ENCODE.on_interrupt() }
}
