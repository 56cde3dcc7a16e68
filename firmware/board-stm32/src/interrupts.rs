//! Interrupts: initialisation, handlers and priorities, and the executors, which run in the
//! interrupts of unused peripherals.
#![expect(
    unsafe_code,
    reason = "interrupts are enabled, and an executor is run by its own interrupt alone"
)]

use embassy_executor::InterruptExecutor;
use embassy_stm32::{
    Config, Peripherals,
    interrupt::{self, InterruptExt, Priority},
    pac::{EXTI, TIM2, exti::regs::Lines},
};
use firmware::deadlines::priority;

use crate::{drdy, trigger};

pub(crate) static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static CONVERSE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static ENCODE: InterruptExecutor = InterruptExecutor::new();

/// Returns a level of [`priority`] as the NVIC stores it: in the upper 4 bits.
pub fn nvic_priority(level: u8) -> Priority {
    Priority::from(level << 4)
}

/// Initialises the chip: clocks, DMA, GPIO, time driver. The interrupts of all pins are disabled
/// afterwards ([`disable_pins`]).
///
/// Also works around an error of the time driver (embassy-stm32 0.6.0, `time_driver/gp16.rs`).
/// While the timer's counter and its compare register 1 are both 0, the driver generates an update,
/// which sets the flag CC1IF; it then enables this flag's interrupt without clearing the flag. It
/// would therefore count half a period that has not passed: `now()` would be ahead by 65,536 us,
/// and would jump back by as much for a moment at each half period. So this function clears the
/// flags before the interrupt first runs. The counter has then been running for some microseconds,
/// far less than its half period of 32.768 ms.
///
/// # Panics
/// On the second call.
pub fn init_chip(config: Config) -> Peripherals {
    // Keeps interrupts disabled from embassy's `init` until the flags are cleared.
    critical_section::with(|_| {
        let peripherals = embassy_stm32::init(config);
        // Writing 0 clears the flags of this register (RM0433, RM0390 and RM0090, TIMx_SR).
        TIM2.sr().write(|flags| flags.0 = 0);
        interrupt::TIM2.unpend();
        disable_pins();
        peripherals
    })
}

/// Sets the priorities of the interrupts that all boards share, and enables DRDY's interrupt. Each
/// board sets the priorities of the interrupts that only this board uses.
pub(crate) fn init() {
    interrupt::EXTI9_5.set_priority(nvic_priority(priority::DRDY));
    interrupt::EXTI15_10.set_priority(nvic_priority(priority::TRIGGER));
    interrupt::TIM2.set_priority(nvic_priority(priority::TIME));
    interrupt::OTG_FS.set_priority(nvic_priority(priority::CONVERSE));
    interrupt::UART4.set_priority(nvic_priority(priority::ACQUIRE));
    interrupt::USART6.set_priority(nvic_priority(priority::CONVERSE));
    interrupt::I2C3_EV.set_priority(nvic_priority(priority::ENCODE));
    // SAFETY: no critical section is open, and this file has the interrupt's handler.
    unsafe { interrupt::EXTI9_5.enable() };
}

/// Disables the interrupts of all pins.
///
/// embassy's feature `exti`, which [`ExtiInput`](embassy_stm32::exti::ExtiInput) needs, enables all
/// these interrupts when it initialises the chip: at the highest priority, and even those that have
/// no handler. Until this call, only EXTI's mask register (IMR) blocks them; after a reset it is
/// zero for all pins. Later, [`init`] enables DRDY's interrupt, and [`enable_trigger`] the
/// trigger's.
fn disable_pins() {
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

/// Clears the pending bits of the EXTI lines in `lines`, so that an edge runs the handler once.
pub(crate) fn clear_pending(lines: u32) {
    EXTI.pr(0).write_value(Lines(lines));
    // The core does not wait for this write. If the handler returned before the write takes effect,
    // it would run again and count an edge that did not happen. A read from the same peripheral
    // waits for the write.
    let _ = EXTI.pr(0).read();
}

/// Enables the trigger's interrupt. If an edge is pending, the handler runs at once.
pub(crate) fn enable_trigger() {
    // SAFETY: this file has the trigger's handler, and no critical section relies on this interrupt
    // being disabled.
    unsafe { interrupt::EXTI15_10.enable() };
}

/// Disables the trigger's interrupt. An edge that occurs while it is disabled stays pending.
pub(crate) fn disable_trigger() {
    interrupt::EXTI15_10.disable();
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
unsafe fn USART6() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { CONVERSE.on_interrupt() }
}

/// Interrupt of an unused peripheral, in which the encoder's executor runs.
#[embassy_stm32::interrupt]
unsafe fn I2C3_EV() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { ENCODE.on_interrupt() }
}
