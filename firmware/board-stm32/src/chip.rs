//! Initialisation of the chip, with corrections to embassy's initialisation.

use embassy_stm32::{
    Config, Peripherals,
    interrupt::{self, InterruptExt},
    pac::TIM2,
};

use crate::exti;

/// Initialises the chip: clocks, DMA, GPIO, time driver. The interrupts of all pins are disabled afterwards
/// (`exti::disable_all`).
///
/// The time driver (embassy-stm32 0.6.0, `time_driver/gp16.rs`) generates an update while counter and compare
/// register 1 are both 0. The update sets the flag CC1IF, and the driver enables the interrupt of this flag
/// without clearing it: the driver would count half a period that has not passed. From then on `now()` would
/// be ahead by 65,536 us, and step back by as much for a moment at each half period. This function therefore
/// clears the flags before the interrupt first runs. The counter has then been running for some microseconds,
/// far from the end of its first half period of 32.768 ms.
///
/// # Panics
/// On the second call.
pub fn init(config: Config) -> Peripherals {
    // The critical sections of embassy's `init` nest in this one, so they do not enable interrupts.
    critical_section::with(|_| {
        let peripherals = embassy_stm32::init(config);
        // Writing 0 clears a flag of this register (RM0433 and RM0390, TIMx_SR).
        TIM2.sr().write(|flags| flags.0 = 0);
        interrupt::TIM2.unpend();
        exti::disable_all();
        peripherals
    })
}
