//! Interrupt handlers, their priorities, and the executors that spare interrupts run.
#![expect(unsafe_code, reason = "an executor is run by its own interrupt alone")]

use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use firmware::deadlines::priority;

use crate::{drdy, trigger};

pub(crate) static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static CONVERSE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static ENCODE: InterruptExecutor = InterruptExecutor::new();

/// Returns a level of [`priority`] as the NVIC stores it, in its upper 4 bits.
pub fn nvic_priority(level: u8) -> Priority {
    Priority::from(level << 4)
}

/// Sets the priorities and enables DRDY's interrupt. A board sets the priorities of the peripherals that only
/// it uses.
pub(crate) fn init() {
    interrupt::EXTI9_5.set_priority(nvic_priority(priority::DRDY));
    interrupt::EXTI15_10.set_priority(nvic_priority(priority::TRIGGER));
    interrupt::TIM2.set_priority(nvic_priority(priority::TIME));
    interrupt::OTG_FS.set_priority(nvic_priority(priority::CONVERSE));
    interrupt::UART4.set_priority(nvic_priority(priority::ACQUIRE));
    interrupt::UART5.set_priority(nvic_priority(priority::CONVERSE));
    interrupt::SAI1.set_priority(nvic_priority(priority::ENCODE));
    // SAFETY: no critical section is open, and the handler of this interrupt is below.
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

/// Spare interrupt: runs the acquisition.
#[embassy_stm32::interrupt]
unsafe fn UART4() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { ACQUIRE.on_interrupt() }
}

/// Spare interrupt: runs the conversation.
#[embassy_stm32::interrupt]
unsafe fn UART5() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { CONVERSE.on_interrupt() }
}

/// Spare interrupt: runs the encoder.
#[embassy_stm32::interrupt]
unsafe fn SAI1() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { ENCODE.on_interrupt() }
}
