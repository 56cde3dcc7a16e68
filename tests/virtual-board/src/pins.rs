//! Pins of the microcontrollers, and which signal each board connects to them.

use std::fmt;

/// A pin: index of its port (0 is port A) and its number in the port.
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

/// Pins that a board connects to the converters and the trigger. The list is a copy from
/// `docs/hardware.md`, not from the firmware, and a test compares it with that document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pins {
    /// Chip selects, chip 0 first.
    pub(crate) selects: [Pin; 8],
    pub(crate) start: Pin,
    pub(crate) reset: Pin,
    pub(crate) drdy: Pin,
    pub(crate) trigger: Pin,
    /// Base address of the GPIO port to which the selects, START and RESET are connected.
    pub(crate) select_port: u64,
    /// Base address of the SPI to which the converters are connected.
    pub(crate) spi: u64,
}

const E: u8 = 4;
const C: u8 = 2;
const B: u8 = 1;

pub(crate) const H743_PINS: Pins = Pins {
    selects: [
        Pin(E, 2),
        Pin(E, 4),
        Pin(E, 5),
        Pin(E, 6),
        Pin(E, 9),
        Pin(E, 11),
        Pin(E, 13),
        Pin(E, 14),
    ],
    start: Pin(E, 10),
    reset: Pin(E, 12),
    drdy: Pin(E, 7),
    trigger: Pin(B, 10),
    select_port: 0x5802_1000,
    spi: 0x4001_3000,
};

pub(crate) const F446_PINS: Pins = Pins {
    selects: [
        Pin(C, 0),
        Pin(C, 1),
        Pin(C, 2),
        Pin(C, 3),
        Pin(C, 8),
        Pin(C, 9),
        Pin(C, 10),
        Pin(C, 11),
    ],
    start: Pin(C, 6),
    reset: Pin(C, 12),
    drdy: Pin(C, 7),
    trigger: Pin(B, 10),
    select_port: 0x4002_0800,
    spi: 0x4000_3800,
};
