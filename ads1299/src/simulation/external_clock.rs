//! A simulated chain whose time another simulation keeps, such as an emulated microcontroller's.
//!
//! Its wires ([`Simulation::chain`]) act at the time that [`Simulation::advance_to`] has set; SPI is
//! clocked with [`Simulation::transfer_at`] instead of through the chain's own bus.

use crate::bus::Speed;
use crate::simulation::Simulation;

/// Fastest SCLK at which the resistors of decision 0011 let registers be read, Hz.
const FASTEST_REGISTERS_HZ: u32 = 105_000;

impl<const CHIPS: usize> Simulation<CHIPS> {
    /// Lets time pass up to `now_ns`, nanoseconds since power on; a time in the past changes nothing.
    pub fn advance_to(&self, now_ns: u64) {
        self.board().advance(now_ns);
    }

    /// Clocks a byte whose last bit is through at `end_ns`, with an SCLK of `sclk_hz`, and returns what
    /// MISO carried meanwhile.
    ///
    /// A register that is read faster than decision 0011's resistors allow is a
    /// [violation](Self::violations).
    pub fn transfer_at(&self, end_ns: u64, sclk_hz: u32, mosi: u8) -> u8 {
        let speed = if sclk_hz <= FASTEST_REGISTERS_HZ {
            Speed::Registers
        } else {
            Speed::Bursts
        };
        self.board().clock_byte(mosi, end_ns, speed)
    }

    /// Falling edges of DRDY so far.
    pub fn ready_edges(&self) -> u64 {
        self.board().edges()
    }

    /// Samples that the electrodes have delivered: the number of the next one.
    pub fn samples_delivered(&self) -> u64 {
        self.board().delivered()
    }
}
