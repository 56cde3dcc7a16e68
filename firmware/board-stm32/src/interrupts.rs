//! Interrupt handlers, their priorities, and the executors, which run in interrupts of unused
//! peripherals.
#![expect(unsafe_code, reason = "an executor is run by its own interrupt alone")]

use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use firmware::deadlines::priority;

use crate::{drdy, trigger};

pub(crate) static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static CONVERSE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static ENCODE: InterruptExecutor = InterruptExecutor::new();

/// Returns a level of [`priority`] in the form in which the NVIC stores it: in the upper 4 bits.
pub fn nvic_priority(level: u8) -> Priority {
    Priority::from(level << 4)
}

/// Sets the priorities and enables DRDY's interrupt. A board itself sets the priorities of
/// peripherals that only this board uses.
pub(crate) fn init() {
    interrupt::EXTI9_5.set_priority(nvic_priority(priority::DRDY));
    interrupt::EXTI15_10.set_priority(nvic_priority(priority::TRIGGER));
    interrupt::TIM2.set_priority(nvic_priority(priority::TIME));
    interrupt::OTG_FS.set_priority(nvic_priority(priority::CONVERSE));
    interrupt::UART4.set_priority(nvic_priority(priority::ACQUIRE));
    interrupt::UART5.set_priority(nvic_priority(priority::CONVERSE));
    interrupt::SAI1.set_priority(nvic_priority(priority::ENCODE));
    // SAFETY: no critical section is open, and this file has the interrupt's handler.
    unsafe { interrupt::EXTI9_5.enable() };
}

#[embassy_stm32::interrupt]
fn EXTI9_5() {
    drdy::on_edge();
}

#[embassy_stm32::interrupt]
fn EXTI15_10() {
    trigger::on_edge();
}

/// Interrupt of an unused peripheral, in which the acquisition's executor runs.
#[embassy_stm32::interrupt]
unsafe fn UART4() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { ACQUIRE.on_interrupt() }
}

/// Interrupt of an unused peripheral, in which the conversation's executor runs.
#[embassy_stm32::interrupt]
unsafe fn UART5() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { CONVERSE.on_interrupt() }
}

/// Interrupt of an unused peripheral, in which the encoder's executor runs.
#[embassy_stm32::interrupt]
unsafe fn SAI1() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { ENCODE.on_interrupt() }
}
