//! Opcodes of the ADS1299, and the times that its commands need.

use crate::clock::Clock;

/// Opcodes (data sheet section 9.5.3). START and RESET are driven by pins; RDATA and STANDBY are
/// not used.
pub(crate) mod opcode {
    /// Read data continuously: the chip sends data at every DRDY and accepts no opcode but
    /// [`SDATAC`]. This is the state after a reset.
    pub(crate) const RDATAC: u8 = 0x10;
    /// Stop reading data continuously: registers can be read and written.
    pub(crate) const SDATAC: u8 = 0x11;
    /// Read registers: ORed with the first address; a byte with the number of registers less one
    /// follows.
    pub(crate) const RREG: u8 = 0x20;
    /// Write registers: ORed with the first address; a byte with the number of registers less one
    /// and the values follow.
    pub(crate) const WREG: u8 = 0x40;
    /// Mask of the opcode's bits in a byte that also holds an address.
    #[cfg(any(test, feature = "simulation"))]
    pub(crate) const MASK: u8 = 0xE0;
}

/// Clock cycles to decode a byte, and to execute a command before the chip is deselected (data
/// sheet section 9.5.3, tSDECODE; 7.6, tSCCS).
pub(crate) const DECODE: u32 = 4;

/// Clock cycles for which a chip must stay deselected between two commands (data sheet section 7.6,
/// tCSH).
pub(crate) const DESELECTED: u32 = 2;

/// Clock cycles from power-up to the reset (data sheet section 11.1, tPOR). By then, VCAP1 must
/// also have reached 1.1 V.
pub(crate) const POWER_ON: u32 = 1 << 18;

/// [`POWER_ON`] at the slowest clock, in microseconds: 175 ms.
pub(crate) const POWER_ON_US: u32 = Clock::SLOWEST.microseconds(POWER_ON);

/// Delay from power-up to the reset on boards that do not measure VCAP1, in microseconds. The data
/// sheet states no charging time for VCAP1's capacitor; its power-up flow waits 1 s (figure 67).
pub(crate) const COLD_US: u32 = 1_000_000;

const _: () = assert!(POWER_ON_US < COLD_US);

/// Clock cycles for which RESET must stay low (data sheet section 11.1, tRST).
pub(crate) const RESET_LOW: u32 = 2;

/// Clock cycles from the end of the reset to the first command (data sheet section 9.4.2).
pub(crate) const AFTER_RESET: u32 = 18;

/// Settling time of the internal reference, in microseconds (data sheet section 7.5).
pub(crate) const REFERENCE_US: u32 = 150_000;
