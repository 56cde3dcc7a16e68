//! Interface between a board and its emulated microcontroller.

pub(crate) mod f446;
pub(crate) mod h743;

use std::fmt;

use rigless::chip::uart;
use rigless::emulator::CoreSpec;
use rigless::mcu::Mcu;
use rigless::time::VirtualNanos;

use crate::chain::Chain;
use crate::core_bus::{ClearedBits, Redirect};
use crate::pins::Pin;

/// An emulated microcontroller: the emulator's model of the part, extended with peripherals that the
/// emulator lacks.
pub(crate) trait Chip: Mcu + fmt::Debug + Send {
    /// Returns the configuration of the processor core for the emulator.
    fn core(&self) -> CoreSpec;

    /// Connects an external clock (HSE) of this frequency, in Hz; 0 disconnects it.
    fn set_external_clock(&mut self, hz: u64);

    /// Returns the register bit (HSERDY) that must read as 0 while no external clock is connected.
    fn hse_ready_flag(&self) -> ClearedBits;

    /// Returns the address ranges whose accesses are redirected, because the emulator's part does not model
    /// the chip's registers there.
    fn redirects(&self) -> Vec<Redirect>;

    /// Sets the frequency, in Hz, of the internal low-speed oscillator (LSI), which clocks the watchdog.
    fn set_lsi_hz(&mut self, hz: u64);

    /// Connects the converters to SPI1 (STM32H743) or SPI2 (STM32F446).
    fn attach_spi(&mut self, chain: Chain);

    /// Connects `peer` to USART3 (STM32H743) or USART2 (STM32F446).
    fn attach_uart(&mut self, peer: Box<dyn uart::Peer>);

    /// Corrupts words that the UART receives: of each million, `per_million` have a framing error and
    /// another `per_million` have noise. At least one data bit of each corrupted word is inverted.
    fn damage_uart(&mut self, per_million: u32);

    /// Returns the frequency of SCLK that the SPI registers configure, in Hz.
    fn sclk_hz(&self) -> u32;

    /// Returns the core clock that the RCC registers configure, in Hz.
    fn core_hz(&self) -> u64;

    /// Returns whether an output pin is high; `None` if the pin is not a general-purpose output.
    fn driven_level(&self, pin: Pin) -> Option<bool>;

    /// Drives an input pin from outside the chip.
    fn drive(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);
}
