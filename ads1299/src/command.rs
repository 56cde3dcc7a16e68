//! The words that a chip understands, and the times it needs.

use crate::clock::Clock;

/// Opcodes (9.5.3). START and RESET have pins here, and RDATA and STANDBY are not used.
pub(crate) mod opcode {
    /// Data at every DRDY; only [`SDATAC`] is understood from then on. So it is after a reset.
    pub(crate) const RDATAC: u8 = 0x10;
    /// Data no more; registers can be read and written.
    pub(crate) const SDATAC: u8 = 0x11;
    /// Read registers: with the first one's address; their number less one follows.
    pub(crate) const RREG: u8 = 0x20;
    /// Write registers: with the first one's address; their number less one and the values follow.
    pub(crate) const WREG: u8 = 0x40;
    /// The bits of the opcode beside an address.
    #[cfg(any(test, feature = "simulation"))]
    pub(crate) const MASK: u8 = 0xE0;
}

/// Cycles that a chip needs to decode a byte, from the end of one to the end of the next, and to
/// carry a command out before it is deselected (9.5.3, tSDECODE; 7.6, tSCCS).
pub(crate) const DECODE: u32 = 4;

/// Cycles for which a chip must stay deselected (7.6, tCSH).
pub(crate) const DESELECTED: u32 = 2;

/// Cycles from power-up to the reset (11.1, tPOR); VCAP1 must have reached 1.1 V as well.
pub(crate) const POWER_ON: u32 = 1 << 18;

/// The same by the slowest clock, us: 175 ms.
pub(crate) const POWER_ON_US: u32 = Clock::SLOWEST.microseconds(POWER_ON);

/// From the supplies to the reset where VCAP1 is not measured, us. The data sheet has no time for its
/// capacitor, and 1 s in the flow of an initial start (11.1, figure 67; from memory).
pub(crate) const COLD_US: u32 = 1_000_000;

const _: () = assert!(POWER_ON_US < COLD_US);

/// Cycles that RESET must stay low (11.1, tRST).
pub(crate) const RESET_LOW: u32 = 2;

/// Cycles from the end of the reset to the first command (9.4.2).
pub(crate) const AFTER_RESET: u32 = 18;

/// Until the internal reference stands, us (7.5).
pub(crate) const REFERENCE_US: u32 = 150_000;
