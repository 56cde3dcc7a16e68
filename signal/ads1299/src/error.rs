//! Errors of a chain of ADS1299 chips: bus, pins, IDs, registers and DRDY.

use core::fmt;

use embedded_hal::{digital, spi};

use crate::bus::{Speed, TooFast};
use crate::register::Register;

/// Reason why a chain or one of its chips does not run. Chip 0 is the chip wired to MISO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The microcontroller's SPI failed.
    Bus(spi::ErrorKind),
    /// The board has no SCLK that is slow enough for this kind of transfer.
    TooFast(Speed, TooFast),
    /// One of the microcontroller's pins could not be driven.
    Pin(Pin, digital::ErrorKind),
    /// A chip does not have the ID of an eight-channel ADS1299.
    WrongId {
        /// Index of the chip; chip 0 is wired to MISO.
        chip: u8,
        /// ID byte that the chip returned.
        read: u8,
    },
    /// A register does not hold the value that was written.
    NotKept {
        /// Index of the chip; chip 0 is wired to MISO.
        chip: u8,
        /// First register that differs.
        register: Register,
        /// Value written to the register.
        wrote: u8,
        /// Value read back from the register.
        read: u8,
    },
    /// DRDY did not fall within `waited_us`. A board wires the DRDY of one chip only.
    NeverReady {
        /// Index of the chip whose DRDY is wired.
        chip: u8,
        /// Time for which the driver waited, in microseconds.
        waited_us: u32,
    },
}

/// Pin of the microcontroller in an [`Error::Pin`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pin {
    /// Chip select of the chip with this index.
    Select(u8),
    /// START, shared by all chips.
    Start,
    /// RESET, shared by all chips.
    Reset,
}

impl fmt::Display for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Select(chip) => write!(formatter, "the chip select of ADS1299 {chip}"),
            Self::Start => formatter.write_str("START"),
            Self::Reset => formatter.write_str("RESET"),
        }
    }
}

impl Error {
    /// Returns the chip that the error concerns; `None` for the bus and for shared pins.
    pub const fn chip(&self) -> Option<u8> {
        match self {
            Self::WrongId { chip, .. }
            | Self::NotKept { chip, .. }
            | Self::NeverReady { chip, .. }
            | Self::Pin(Pin::Select(chip), _) => Some(*chip),
            Self::Bus(_) | Self::TooFast(..) | Self::Pin(..) => None,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Bus(kind) => write!(
                formatter,
                "the SPI to the ADS1299 failed ({kind}); check its clock and its DMA buffers"
            ),
            Self::TooFast(speed, TooFast { hz }) => {
                let what = match speed {
                    Speed::Registers => "registers",
                    Speed::Bursts => "frames",
                };
                write!(
                    formatter,
                    "{hz} Hz is the slowest SCLK at hand, too fast for {what}; check the clock of \
                     the SPI and its dividers"
                )
            }
            Self::Pin(pin, kind) => write!(formatter, "{pin} could not be driven ({kind})"),
            Self::WrongId { chip, read } => {
                let cause = match read {
                    0x00 => {
                        "all zeros: MISO is held low, or the chip has no power, no clock, or is \
                             in reset; check its supplies, CLK, PWDN and RESET"
                    }
                    0xFF => {
                        "all ones: nothing drives MISO; check the chip's select, and the way \
                             from its DOUT to MISO"
                    }
                    _ if read & 0x1C == 0x1C => {
                        "an ADS1299-4 or -6; this driver wants eight \
                                                 channels"
                    }
                    _ if read & 0x1C == 0x10 => "an ADS1294, 1296 or 1298, whose registers differ",
                    _ => "not an ADS1299, or damaged bits; check SPI mode 1, and try a slower SCLK",
                };
                write!(
                    formatter,
                    "ADS1299 {chip} of the chain answers with ID 0x{read:02X} instead of 0x{:02X}: \
                     {cause}",
                    crate::register::ID
                )
            }
            Self::NotKept { chip, register, wrote, read } => write!(
                formatter,
                "{register} of ADS1299 {chip} holds 0x{read:02X}, and 0x{wrote:02X} was written: \
                 the bus drops bits or the chip was reset in between; try a slower SCLK, and look at \
                 RESET and the supplies"
            ),
            Self::NeverReady { chip, waited_us } => write!(
                formatter,
                "ADS1299 {chip} made no sample in {waited_us} us after START: DRDY never fell; check \
                 START, CLK, and that the DRDY wired is that of chip {chip}"
            ),
        }
    }
}

impl core::error::Error for Error {}
