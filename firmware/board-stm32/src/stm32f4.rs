//! Code that all boards with an STM32F4 share: clocks, the timer at the HSE input, the cause of a
//! reset, registers of a UART, and the session id.

mod clocks;
mod hse_timer;
mod reset;
pub mod uart;

use embassy_stm32::{
    Peri,
    adc::{Adc, SampleTime},
    peripherals::ADC1,
};

pub use clocks::{AFTER_RESET_HZ, config, enable_flash_accelerator};
pub use hse_timer::Timer as HseTimer;
pub use reset::{freeze_watchdog_in_debug, map_system_memory, take_cause};

/// Returns a number derived from the noise of the temperature sensor: 64 readings, hashed with
/// FNV-1a. Not every chip of the family has a random number generator. The number distinguishes one
/// boot from another and need not be secret.
pub fn session_id(adc: Peri<'static, ADC1>) -> u32 {
    let mut adc = Adc::new(adc);
    let mut thermometer = adc.enable_temperature();
    (0..64).fold(0x811c_9dc5, |id: u32, _| {
        let reading = adc.blocking_read(&mut thermometer, SampleTime::CYCLES3);
        (id ^ u32::from(reading)).wrapping_mul(0x0100_0193)
    })
}
