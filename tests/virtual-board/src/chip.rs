//! Interface between a board and its emulated microcontroller.

use std::fmt;

use rigless::chip::uart;
use rigless::emulator::CoreSpec;
use rigless::mcu::Mcu;
use rigless::time::VirtualNanos;

use crate::chain::Chain;
use crate::core_bus::{ClearedBits, Redirect};
use crate::model::Pin;

/// Defines the methods of [`Chip`] that read the same for both chips. Each chip has its own types
/// for `part`, for the registers and for the indices that the methods use. `spare_timer` takes the
/// place of TIM2 while TIM2 is moved out of the part.
macro_rules! common_to_both_chips {
    ($spare_timer:expr) => {
        fn set_external_clock(&mut self, hz: u64) {
            self.part.rcc.attach_crystals(hz, 0);
        }

        fn hse_ready_flag(&self) -> ClearedBits {
            ClearedBits {
                address: RCC_CR,
                bits: HSERDY,
            }
        }

        fn set_lsi_hz(&mut self, hz: u64) {
            self.part.rcc.calibrate_lsi(hz);
        }

        fn attach_spi(&mut self, chain: Chain) {
            self.part.spi[SPI].attach(chain);
        }

        fn attach_uart(&mut self, peer: Box<dyn uart::Peer>) {
            self.part.usart[UART].attach_boxed(peer);
        }

        fn damage_uart(&mut self, per_million: u32) {
            let errors = self.part.usart[UART].errors_mut();
            [errors.framing, errors.noise] =
                ["framing", "noise"].map(|name| Rate { name, per_million });
        }

        fn driven_level(&self, pin: Pin) -> Option<bool> {
            let registers = self.bus().registers(PORTS[pin.port()])?;
            let mode = registers.get(gpioa::Register::Moder) >> (2 * u32::from(pin.1)) & 0b11;
            let is_high = registers.get(gpioa::Register::Odr) >> u32::from(pin.1) & 1 != 0;
            (mode == 0b01).then_some(is_high)
        }

        fn drive_timer(&mut self, at: VirtualNanos, pin: Pin, is_high: bool) {
            let registers = self.part.bus().registers(PORTS[pin.port()]);
            let part_pin = PartPin::new(pin.1).expect("a port has 16 pins");
            let function = registers.and_then(|registers| Gpio::function(part_pin, registers));
            if function != Some(TIMER_FUNCTION) {
                return;
            }
            let channel = Channel::new(3).expect("TIM2 has four channels");
            let slot = self.part.bus().slot(TIMERS[TIMER].instance);
            let slot = slot.expect("the part has TIM2");
            // The timer is moved out of the part during the call, because the part's registers are
            // borrowed at the same time.
            let mut timer = mem::replace(&mut self.part.tim[TIMER], $spare_timer);
            let (registers, mut context) = self.part.bus_mut().drive(at, slot);
            timer.drive_input(channel, Level::from(is_high), registers, &mut context);
            self.part.tim[TIMER] = timer;
        }

        fn drive_part(&mut self, at: VirtualNanos, pin: Pin, is_high: bool) {
            self.drive_timer(at, pin, is_high);
            let part_pin = PartPin::new(pin.1).expect("a port has 16 pins");
            let level = Some(Level::from(is_high));
            self.part
                .drive_port(at, pin.port(), |gpio, registers, context| {
                    gpio.drive(part_pin, level, registers, context);
                });
        }
    };
}

pub(crate) mod f446;
pub(crate) mod h743;

/// An emulated microcontroller: the emulator's model of the part, extended with peripherals that
/// the emulator lacks.
pub(crate) trait Chip: Mcu + fmt::Debug + Send {
    /// Returns the configuration of the processor core for the emulator.
    fn core(&self) -> CoreSpec;

    /// Connects an external clock (HSE) of this frequency, in Hz; 0 disconnects it.
    fn set_external_clock(&mut self, hz: u64);

    /// Returns the register bit (HSERDY) that must read as 0 while no external clock is connected.
    fn hse_ready_flag(&self) -> ClearedBits;

    /// Returns the address ranges whose accesses are redirected, because the emulator's part does
    /// not model the chip's registers there.
    fn redirects(&self) -> Vec<Redirect>;

    /// Sets the frequency, in Hz, of the internal low-speed oscillator (LSI), which clocks the
    /// watchdog.
    fn set_lsi_hz(&mut self, hz: u64);

    /// Connects the converters to SPI1 (STM32H743) or SPI2 (STM32F446).
    fn attach_spi(&mut self, chain: Chain);

    /// Connects `peer` to USART3 (STM32H743) or USART2 (STM32F446).
    fn attach_uart(&mut self, peer: Box<dyn uart::Peer>);

    /// Corrupts words that the UART receives: of each million, `per_million` have a framing error
    /// and another `per_million` have noise. At least one data bit of each corrupted word is
    /// inverted.
    fn damage_uart(&mut self, per_million: u32);

    /// Returns the frequency of SCLK that the SPI registers configure, in Hz.
    fn sclk_hz(&self) -> u32;

    /// Returns the core clock that the RCC registers configure, in Hz.
    fn core_hz(&self) -> u64;

    /// Returns whether an output pin is high; `None` if the pin is not a general-purpose output.
    fn driven_level(&self, pin: Pin) -> Option<bool>;

    /// Drives the trigger's input of the timer, if the pin has the timer's alternate function.
    fn drive_timer(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);

    /// Drives an input pin of the emulator's part, and the timer's input.
    fn drive_part(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);

    /// Drives an input pin from outside the chip.
    fn drive(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);
}
