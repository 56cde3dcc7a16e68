//! Why a chain does not run.

use core::fmt;

use embedded_hal::{digital, spi};

use crate::bus::{Speed, TooFast};
use crate::register::Register;

/// Why a chain does not run. Chips count from 0, the one at MISO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The microcontroller's SPI failed.
    Bus(spi::ErrorKind),
    /// The board has no SCLK that is slow enough.
    TooFast(Speed, TooFast),
    /// One of the microcontroller's pins failed.
    Pin(Pin, digital::ErrorKind),
    /// A chip's ID is not that of an eight-channel ADS1299.
    WrongId {
        /// Which.
        chip: u8,
        /// What it answered.
        read: u8,
    },
    /// A register did not keep what was written.
    NotKept {
        /// Which chip.
        chip: u8,
        /// Which register.
        register: Register,
        /// What was written.
        wrote: u8,
        /// What was read.
        read: u8,
    },
    /// The chip whose DRDY is wired makes no sample.
    NeverReady {
        /// Which.
        chip: u8,
        /// For how long, us.
        waited_us: u32,
    },
}

/// A pin of the microcontroller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pin {
    /// A chip's select.
    Select(u8),
    /// START.
    Start,
    /// RESET.
    Reset,
    /// DRDY.
    Ready,
}

impl fmt::Display for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Select(chip) => write!(formatter, "the chip select of ADS1299 {chip}"),
            Self::Start => formatter.write_str("START"),
            Self::Reset => formatter.write_str("RESET"),
            Self::Ready => formatter.write_str("DRDY"),
        }
    }
}

impl Error {
    /// The chip that it is about, if it is about one.
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
            Self::Pin(pin, kind) => write!(formatter, "{pin} could not be driven or read ({kind})"),
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
            Self::NotKept {
                chip,
                register,
                wrote,
                read,
            } => write!(
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
