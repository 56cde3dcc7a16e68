//! Initialisation of the chip: embassy's, with corrections.

use embassy_stm32::{
    Config, Peripherals,
    interrupt::{self, InterruptExt},
    pac::TIM2,
};

use crate::exti;

/// Initialises the chip: clocks, DMA, GPIO, time driver. The interrupts of all pins are disabled
/// afterwards (`exti::disable_all`).
///
/// The time driver (embassy-stm32 0.6.0, `time_driver/gp16.rs`) generates an update while the
/// timer's counter and its compare register 1 are both 0. The update sets the flag CC1IF, and the
/// driver enables the interrupt of this flag without clearing the flag. The driver would therefore
/// count half a period that has not passed. From then on, `now()` would be ahead by 65,536 us, and
/// for a moment at each half period it would jump back by as much. This function therefore clears
/// the flags before the interrupt first runs. By then the counter has been running for some
/// microseconds, far less than its half period of 32.768 ms.
///
/// # Panics
/// On the second call.
pub fn init(config: Config) -> Peripherals {
    // Embassy's `init` has critical sections of its own. Nested in this one, they do not enable
    // interrupts when they end.
    critical_section::with(|_| {
        let peripherals = embassy_stm32::init(config);
        // Writing 0 clears the flags of this register (RM0433 and RM0390, TIMx_SR).
        TIM2.sr().write(|flags| flags.0 = 0);
        interrupt::TIM2.unpend();
        exti::disable_all();
        peripherals
    })
}
