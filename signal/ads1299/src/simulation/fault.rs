//! Faults that a test can inject into a simulated chip.

use crate::register::Register;

/// Fault of a simulated chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No power: accepts no command, DOUT low, DRDY high. Blocks the data of the chips after it.
    Dead,
    /// Sends the data of its last sample again, in every frame.
    StuckData,
    /// Returns this byte as its ID.
    WrongId(u8),
    /// Converts at twice the rate. Only chip 0 shows this fault, because only its DRDY is wired.
    DoubleRate,
    /// Omits the next edge of DRDY, once. Only chip 0 shows this fault, because only its DRDY is wired.
    MissedReady,
    /// Sends these four bits in place of 1100 at the start of its status word.
    WrongNibble(u8),
    /// Delays its data, and those of the chips after it, by one bit.
    ShiftedBit,
    /// Ignores writes to this register.
    Forgets(Register),
}
