//! Interface between a virtual board and its emulated microcontroller.

use std::fmt;
use std::num::NonZeroU64;

use rigless::chip::uart;
use rigless::emulator::CoreSpec;
use rigless::mcu::Mcu;
use rigless::time::VirtualNanos;

use crate::chain::Chain;
use crate::core_bus::Redirect;
use crate::model::Pin;

/// Defines the methods of [`Chip`] whose source text is the same for all chips. Each chip's module
/// defines the types, registers and indices that the text names. `spare_timer` replaces TIM2 while
/// a method has moved TIM2 out of the part.
macro_rules! common_to_all_chips {
    ($spare_timer:expr) => {
        fn set_external_clock(&mut self, hz: u64) {
            self.part.rcc.attach_crystals(hz, 0);
            self.hse_timer.hse_hz = hz;
        }

        fn hse_ready_flag(&self) -> (u64, u64) {
            (RCC_CR, HSERDY)
        }

        fn usb_idle_flag(&self) -> (u64, u64) {
            (GRSTCTL, AHBIDL)
        }

        fn set_lsi_hz(&mut self, hz: u64) {
            self.part.rcc.calibrate_lsi(hz);
        }

        fn attach_spi(&mut self, chain: Chain) {
            let spi = self.spi();
            self.part.spi[spi].attach(chain);
        }

        fn attach_uart(&mut self, peer: Box<dyn uart::Peer>) {
            let uart = self.uart();
            self.part.usart[uart].attach_boxed(peer);
        }

        fn damage_uart(&mut self, per_million: u32) {
            let uart = self.uart();
            let errors = self.part.usart[uart].errors_mut();
            [errors.framing, errors.noise] =
                ["framing", "noise"].map(|name| Rate { name, per_million });
        }

        fn driven_level(&self, pin: Pin) -> Option<bool> {
            let registers = self.bus().registers(PORTS[pin.port()])?;
            let mode = registers.get(gpioa::Register::Moder) >> (2 * u32::from(pin.1)) & 0b11;
            let is_high = registers.get(gpioa::Register::Odr) >> u32::from(pin.1) & 1 != 0;
            (mode == 0b01).then_some(is_high)
        }

        fn speed_and_pull(&self, pin: Pin) -> Option<(u64, u64)> {
            let registers = self.bus().registers(PORTS[pin.port()])?;
            let field = |register| registers.get(register) >> (2 * u32::from(pin.1)) & 0b11;
            Some((field(gpioa::Register::Ospeedr), field(gpioa::Register::Pupdr)))
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
            // Move the timer out of the part during the call, which needs the part's registers as
            // well.
            let mut timer = mem::replace(&mut self.part.tim[TIMER], $spare_timer);
            let (registers, mut context) = self.part.bus_mut().drive(at, slot);
            timer.drive_input(channel, Level::from(is_high), registers, &mut context);
            self.part.tim[TIMER] = timer;
        }

        fn drive_part(&mut self, at: VirtualNanos, pin: Pin, is_high: bool) {
            self.drive_timer(at, pin, is_high);
            let part_pin = PartPin::new(pin.1).expect("a port has 16 pins");
            let level = Some(Level::from(is_high));
            self.part.drive_port(at, pin.port(), |gpio, registers, context| {
                gpio.drive(part_pin, level, registers, context);
            });
        }
    };
}

pub(crate) mod f4;
pub(crate) mod h743;
mod hse_timer;

/// An emulated microcontroller: the emulator's model of the part, with added models of peripherals
/// that the emulator lacks.
pub(crate) trait Chip: Mcu + fmt::Debug + Send {
    /// Returns the configuration of a core with this speed, in the emulator's form.
    fn core(&self, instructions_per_second: NonZeroU64) -> CoreSpec;

    /// Connects an external clock (HSE) with the frequency `hz`; 0 disconnects it.
    fn set_external_clock(&mut self, hz: u64);

    /// Returns the address of RCC_CR and its bit HSERDY, which must read as 0 without an external
    /// clock.
    fn hse_ready_flag(&self) -> (u64, u64);

    /// Returns the address of the USB core's register GRSTCTL and its bit AHBIDL.
    fn usb_idle_flag(&self) -> (u64, u64);

    /// Returns the ranges of addresses whose accesses go to other addresses, because the emulator's
    /// part lacks the chip's registers there.
    fn redirects(&self) -> Vec<Redirect>;

    /// Sets the frequency in Hz of the internal low-speed oscillator (LSI), the watchdog's clock.
    fn set_lsi_hz(&mut self, hz: u64);

    /// Connects the converters to the board's SPI.
    fn attach_spi(&mut self, chain: Chain);

    /// Connects `peer` to the board's UART.
    fn attach_uart(&mut self, peer: Box<dyn uart::Peer>);

    /// Corrupts words that the UART receives: of each million, `per_million` get a framing error
    /// and as many others a noise error. Each corrupted word also has at least one inverted data
    /// bit.
    fn damage_uart(&mut self, per_million: u32);

    /// Returns the frequency of SCLK, in Hz, that the SPI registers select.
    fn sclk_hz(&self) -> u32;

    /// Returns the core clock frequency, in Hz, that the RCC registers select.
    fn core_hz(&self) -> u64;

    /// Returns whether the chip drives `pin` high; `None` if the pin is no general-purpose output.
    fn driven_level(&self, pin: Pin) -> Option<bool>;

    /// Returns a pin's speed (OSPEEDR, 0 is the slowest) and pull (PUPDR, 0 none, 1 up, 2 down).
    fn speed_and_pull(&self, pin: Pin) -> Option<(u64, u64)>;

    /// Sets the level of the timer's trigger input, if `pin` has the timer's alternate function.
    fn drive_timer(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);

    /// Sets the level of a pin of the emulated part and of the timer input that it drives, if any.
    fn drive_part(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);

    /// Sets the level of an input pin, both in the emulated part and in the models added to it.
    fn drive(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);
}
