//! Access to a simulated chain whose time is set from outside, such as by an emulated microcontroller.
//!
//! The wires of [`Simulation::chain`] act at the time set by [`Simulation::advance_to`]. SPI is clocked with
//! [`Simulation::transfer_at`] instead of the chain's bus.

use crate::bus::Speed;
use crate::simulation::Simulation;

/// Fastest SCLK for reading registers through the resistors of decision 0011, in Hz.
const FASTEST_REGISTERS_HZ: u32 = 105_000;

impl<const CHIPS: usize> Simulation<CHIPS> {
    /// Advances time to `now_ns`, in nanoseconds since creation; no effect for a time in the past.
    pub fn advance_to(&self, now_ns: u64) {
        self.board().advance(now_ns);
    }

    /// Transfers a byte that ends at `end_ns`, with an SCLK of `sclk_hz`, and returns the byte on MISO.
    ///
    /// Reading a register faster than decision 0011's resistors allow is a
    /// [violation](Self::violations).
    pub fn transfer_at(&self, end_ns: u64, sclk_hz: u32, mosi: u8) -> u8 {
        let speed = if sclk_hz <= FASTEST_REGISTERS_HZ {
            Speed::Registers
        } else {
            Speed::Bursts
        };
        self.board().clock_byte(mosi, end_ns, speed)
    }

    /// Returns the number of falling edges of DRDY.
    pub fn ready_edges(&self) -> u64 {
        self.board().edges()
    }

    /// Returns the number of samples that the electrodes have delivered.
    pub fn samples_delivered(&self) -> u64 {
        self.board().delivered()
    }
}
