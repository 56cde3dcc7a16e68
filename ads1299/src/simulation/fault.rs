//! What can be broken.

use crate::register::Register;

/// What can be broken in a chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No power: understands nothing, DOUT low, DRDY high. What the chips behind it send does not
    /// get past it.
    Dead,
    /// Sends its last sample for ever.
    StuckData,
    /// Says to be something else.
    WrongId(u8),
    /// Converts twice as fast as it should; to be seen at chip 0, whose DRDY is wired.
    DoubleRate,
    /// Its next edge of DRDY does not come; once, and only to be seen at chip 0.
    MissedReady,
    /// Its status does not begin with 1100 but with this.
    WrongNibble(u8),
    /// It and the chips behind it come a bit late.
    ShiftedBit,
    /// A register keeps its value whatever is written.
    Forgets(Register),
}
