//! What a board needs of an emulated microcontroller.

mod f446;
mod h743;

use std::fmt;

use rigless::chip::uart;
use rigless::emulator::CoreSpec;
use rigless::mcu::Mcu;
use rigless::time::VirtualNanos;

use crate::chain::Chain;
use crate::core_bus::{Cleared, Redirect};

pub(crate) use f446::F446;
pub(crate) use h743::H743;

/// A pin: number of its port, 0 for A, and of the pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pin(pub(crate) u8, pub(crate) u8);

impl Pin {
    pub(crate) const fn port(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "P{}{}", char::from(b'A' + self.0), self.1)
    }
}

/// An emulated microcontroller with what the part's own models lack.
pub(crate) trait Chip: Mcu + fmt::Debug + Send {
    /// Its core, as the emulator makes it.
    fn core(&self) -> CoreSpec;

    /// Fits a crystal or an external clock, Hz; 0 is none.
    fn fit_clock(&mut self, hz: u64);

    /// The flag that says that the clock from outside is ready.
    fn clock_ready(&self) -> Cleared;

    /// Addresses at which the emulator's part has something else than the chip.
    fn redirects(&self) -> Vec<Redirect>;

    /// Sets the rate of the internal low-speed oscillator, which the watchdog counts, Hz.
    fn set_lsi(&mut self, hz: u64);

    /// Attaches the converters' SPI.
    fn attach_spi(&mut self, chain: Chain);

    /// Attaches the far end of the UART.
    fn attach_uart(&mut self, peer: Box<dyn uart::Peer>);

    /// Damages words on their way to the UART: `per_million` of them arrive with a framing error, and as many with
    /// noise, all with wrong bits.
    fn damage_uart(&mut self, per_million: u32);

    /// SCLK as the registers set it, Hz.
    fn sclk_hz(&self) -> u32;

    /// The core clock as the registers set it, Hz.
    fn core_hz(&self) -> u64;

    /// What the microcontroller drives on a pin; none unless the pin is an output.
    fn output(&self, pin: Pin) -> Option<bool>;

    /// Drives a pin from outside.
    fn drive(&mut self, at: VirtualNanos, pin: Pin, is_high: bool);
}
