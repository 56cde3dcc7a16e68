//! The chip's first initialisation, with the time driver's counter and its periods in step and no
//! interrupt of a pin.

use embassy_stm32::{
    Config, Peripherals,
    interrupt::{self, InterruptExt},
    pac::TIM2,
};

use crate::interrupts;

/// Initialises the chip: clocks, DMA, GPIO, time driver.
///
/// The time driver (embassy-stm32 0.6.0, `time_driver/gp16.rs`) generates an update while counter and
/// compare register 1 are both 0. That sets CC1IF, and the driver enables its interrupt without clearing
/// the flag: it would count half a period that has not passed. From then on `now()` is ahead by 65,536 us,
/// and steps back by as much for a moment at each half period. So the flags are cleared here before the
/// interrupt runs for the first time; the counter has been running for some microseconds, far from its
/// first half period of 32.768 ms.
///
/// The interrupts of all pins are disabled ([`interrupts::silence_pins`]).
///
/// # Panics
/// When it is called twice.
pub fn init(config: Config) -> Peripherals {
    // Nests: the critical sections within do not enable interrupts again.
    critical_section::with(|_| {
        let peripherals = embassy_stm32::init(config);
        // Flags of this register are cleared by writing 0 (RM0433 and RM0390, TIMx_SR).
        TIM2.sr().write(|flags| flags.0 = 0);
        interrupt::TIM2.unpend();
        interrupts::silence_pins();
        peripherals
    })
}
