//! Addresses, reset values and fixed bits of a chip's registers.

use core::fmt;

/// ID of an eight-channel ADS1299: bit 4 is 1, DEV_ID 11, NU_CH 10 (data sheet section 9.6.1.1).
/// The upper three bits are the revision, 001 in every part known to the authors.
pub const ID: u8 = 0x3E;

/// Bits of the ID that identify the part, without the revision.
pub(crate) const ID_MASK: u8 = 0x1F;

/// Register address (data sheet section 9.6, table 11).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Register(u8);

impl Register {
    /// ID: part and revision; read only.
    pub const ID: Self = Self(0x00);
    /// Daisy chain, clock output and sample rate.
    pub const CONFIG1: Self = Self(0x01);
    /// Test signal: source, amplitude and frequency.
    pub const CONFIG2: Self = Self(0x02);
    /// Reference buffer and bias amplifier.
    pub const CONFIG3: Self = Self(0x03);
    /// Lead-off: threshold, current, frequency.
    pub const LOFF: Self = Self(0x04);
    /// Channel 1: power, gain, SRB2, input. The registers of channels 2 to 8 follow.
    pub const CH1SET: Self = Self(0x05);
    /// Positive inputs from which the bias is derived, one bit each.
    pub const BIAS_SENSP: Self = Self(0x0D);
    /// Negative inputs from which the bias is derived, one bit each.
    pub const BIAS_SENSN: Self = Self(0x0E);
    /// Positive inputs with lead-off current, one bit each.
    pub const LOFF_SENSP: Self = Self(0x0F);
    /// Negative inputs with lead-off current, one bit each.
    pub const LOFF_SENSN: Self = Self(0x10);
    /// Channels with reversed lead-off current, one bit each.
    pub const LOFF_FLIP: Self = Self(0x11);
    /// Positive inputs at which an electrode is disconnected, one bit each; read only.
    pub const LOFF_STATP: Self = Self(0x12);
    /// Negative inputs at which an electrode is disconnected, one bit each; read only.
    pub const LOFF_STATN: Self = Self(0x13);
    /// GPIO pins: data in the upper four bits, direction in the lower four (1 is input).
    pub const GPIO: Self = Self(0x14);
    /// Switch that connects SRB1 to all negative inputs as their common reference.
    pub const MISC1: Self = Self(0x15);
    /// Reserved; always 0.
    pub const MISC2: Self = Self(0x16);
    /// Single-shot mode, and power of the lead-off comparators.
    pub const CONFIG4: Self = Self(0x17);

    /// Number of registers of a chip, the read-only ones included.
    pub const COUNT: usize = 24;

    /// Values of all registers after a reset, by address.
    pub const RESET: [u8; Self::COUNT] = [
        ID, 0x96, 0xC0, 0x60, 0x00, // ID, CONFIG1 to 3, LOFF
        0x61, 0x61, 0x61, 0x61, 0x61, 0x61, 0x61, 0x61, // CHnSET: gain 24, shorted
        0x00, 0x00, 0x00, 0x00, 0x00, // BIAS_SENS, LOFF_SENS, LOFF_FLIP
        0x00, 0x00, // LOFF_STAT
        0x0F, 0x00, 0x00, 0x00, // GPIO, MISC1, MISC2, CONFIG4
    ];

    /// Mask of the bits of each register that read back as written: all but the ID, lead-off
    /// status, CONFIG3.BIAS_STAT, and the data of the GPIO pins, which are inputs.
    pub(crate) const KEPT: [u8; Self::COUNT] = [
        0x00, 0xFF, 0xFF, 0xFE, 0xFF, // ID, CONFIG1 to 3, LOFF
        0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, // CHnSET
        0xFF, 0xFF, 0xFF, 0xFF, 0xFF, // BIAS_SENS, LOFF_SENS, LOFF_FLIP
        0x00, 0x00, // LOFF_STAT
        0x0F, 0xFF, 0xFF, 0xFF, // GPIO, MISC1, MISC2, CONFIG4
    ];

    /// Returns the register at `address`; `None` from [`Self::COUNT`] on.
    pub const fn at(address: u8) -> Option<Self> {
        if address as usize >= Self::COUNT {
            return None;
        }
        Some(Self(address))
    }

    /// Returns the address, below [`Self::COUNT`].
    pub const fn address(self) -> u8 {
        self.0
    }

    /// Returns the address as an index into [`Self::RESET`] and other register arrays.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for Register {
    /// Writes the register's name as in the data sheet.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NAMES: [&str; Register::COUNT] = [
            "ID",
            "CONFIG1",
            "CONFIG2",
            "CONFIG3",
            "LOFF",
            "CH1SET",
            "CH2SET",
            "CH3SET",
            "CH4SET",
            "CH5SET",
            "CH6SET",
            "CH7SET",
            "CH8SET",
            "BIAS_SENSP",
            "BIAS_SENSN",
            "LOFF_SENSP",
            "LOFF_SENSN",
            "LOFF_FLIP",
            "LOFF_STATP",
            "LOFF_STATN",
            "GPIO",
            "MISC1",
            "MISC2",
            "CONFIG4",
        ];
        formatter.write_str(NAMES[self.index()])
    }
}
