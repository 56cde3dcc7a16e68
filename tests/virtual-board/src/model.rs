//! The boards, and which of their pins go where.

use std::fmt;
use std::num::NonZeroU64;

use crate::chip::{Chip, F446, H743, Pin};
use crate::setup::Cable;
use crate::usb::UsbHost;

/// A board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// NUCLEO-H743ZI2, the default board.
    H743,
    /// NUCLEO-F446RE.
    F446,
}

/// The pins of a board that the converters and the trigger are wired to. A copy of `docs/hardware.md`,
/// not of the firmware's own table: a test compares the two.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pins {
    /// Chip selects, chip 0 first.
    pub(crate) selects: [Pin; 8],
    pub(crate) start: Pin,
    pub(crate) reset: Pin,
    pub(crate) drdy: Pin,
    pub(crate) trigger: Pin,
    /// Address of the port that the selects, START and RESET are on.
    pub(crate) select_port: u64,
    /// Address of the SPI.
    pub(crate) spi: u64,
}

const E: u8 = 4;
const C: u8 = 2;
const B: u8 = 1;

const H743_PINS: Pins = Pins {
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

const F446_PINS: Pins = Pins {
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

impl Model {
    /// Both boards.
    pub const ALL: [Self; 2] = [Self::H743, Self::F446];

    /// The word that names it in commands.
    pub const fn key(self) -> &'static str {
        match self {
            Self::H743 => "h743",
            Self::F446 => "f446",
        }
    }

    /// The cable that its default image talks over.
    pub const fn default_cable(self) -> Cable {
        match self {
            Self::H743 => Cable::Usb,
            Self::F446 => Cable::Uart,
        }
    }

    /// The board's name, as in `Hello`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::H743 => "NUCLEO-H743ZI2",
            Self::F446 => "NUCLEO-F446RE",
        }
    }

    /// Bytes of flash and RAM that the chip has, with the addresses where they begin (DS12110 and DS10693,
    /// memory mapping). The emulated chip of the STM32F446 is an STM32F427, which has more of both.
    pub(crate) const fn memories(self) -> &'static [(&'static str, u64, u64)] {
        match self {
            Self::H743 => &[
                ("flash", 0x0800_0000, 2048 << 10),
                ("ITCM", 0x0000_0000, 64 << 10),
                ("DTCM", 0x2000_0000, 128 << 10),
                ("AXI SRAM", 0x2400_0000, 512 << 10),
                ("SRAM1 to 3", 0x3000_0000, 288 << 10),
            ],
            Self::F446 => &[
                ("flash", 0x0800_0000, 512 << 10),
                ("SRAM", 0x2000_0000, 128 << 10),
            ],
        }
    }

    /// Whether DMA1 reaches an address (RM0433, 2.1; RM0390, 2.1): on the STM32H743 not the TCMs.
    pub fn dma_reaches(self, address: u64) -> bool {
        let [axi, sram1_to_3, f446] = [
            0x2400_0000..0x2408_0000,
            0x3000_0000..0x3004_8000,
            0x2000_0000..0x2002_0000_u64,
        ];
        match self {
            Self::H743 => axi.contains(&address) || sram1_to_3.contains(&address),
            Self::F446 => f446.contains(&address),
        }
    }

    /// Where DMA1 is.
    pub(crate) const fn dma(self) -> u64 {
        match self {
            Self::H743 => 0x4002_0000,
            Self::F446 => 0x4002_6000,
        }
    }

    /// Core clock that the firmware sets, Hz.
    pub const fn core_hz(self) -> u64 {
        match self {
            Self::H743 => 480_000_000,
            Self::F446 => 168_000_000,
        }
    }

    /// Core clock after a reset, from the internal oscillator, Hz (RM0433, 8.5.2; RM0390, 6.2.2).
    pub const fn reset_hz(self) -> u64 {
        match self {
            Self::H743 => 64_000_000,
            Self::F446 => 16_000_000,
        }
    }

    /// Instructions that the emulated core retires in a second of virtual time. Assumed: about half an
    /// instruction in a cycle, from flash with the caches on. It decides how late the firmware is, not
    /// what it computes.
    ///
    /// # Panics
    /// Never: the rates are not 0.
    pub const fn instructions_per_second(self) -> NonZeroU64 {
        let rate = match self {
            Self::H743 => 250_000_000,
            Self::F446 => 103_000_000,
        };
        NonZeroU64::new(rate).expect("a core that runs")
    }

    pub(crate) const fn pins(self) -> &'static Pins {
        match self {
            Self::H743 => &H743_PINS,
            Self::F446 => &F446_PINS,
        }
    }

    /// The chip, with `host` at its USB cable.
    pub(crate) fn chip(self, host: &UsbHost) -> Box<dyn Chip> {
        match self {
            Self::H743 => Box::new(H743::new(host)),
            Self::F446 => Box::new(F446::new(host)),
        }
    }
}

impl fmt::Display for Model {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cells of the rows below a board's heading: signal and pin.
    fn documented(model: Model) -> Vec<(String, String)> {
        let text = include_str!("../../../docs/hardware.md");
        let heading = format!("### {model}");
        let section = text.split(&heading).nth(1).expect("the board's section");
        let rows = section.split("\n#").next().unwrap_or(section).lines();
        let rows = rows.filter(|line| line.starts_with('|')).skip(2);
        let cells = rows.map(|row| row.trim_matches('|').split('|').map(str::trim));
        cells
            .map(|mut cells| {
                let mut next = || cells.next().unwrap_or_default().to_owned();
                (next(), next())
            })
            .collect()
    }

    #[test]
    fn the_wires_go_where_the_documentation_says() {
        for model in Model::ALL {
            let pins = model.pins();
            let mut wires: Vec<(String, Pin)> = (0..)
                .zip(pins.selects)
                .map(|(chip, pin)| (format!("CS {chip}"), pin))
                .collect();
            for (signal, pin) in [
                ("START", pins.start),
                ("RESET", pins.reset),
                ("DRDY", pins.drdy),
                ("TRIGGER", pins.trigger),
            ] {
                wires.push((signal.to_owned(), pin));
            }
            let documented = documented(model);
            for (signal, pin) in wires {
                let row = documented.iter().find(|(name, _)| *name == signal);
                let name = row.map(|(_, pin)| pin.as_str());
                assert_eq!(name, Some(pin.to_string().as_str()), "{model}: {signal}");
            }
        }
    }
}
