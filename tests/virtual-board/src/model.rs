//! Facts about the boards: names, memories, clocks, and which signal is on which pin.

use std::fmt;

use clap::ValueEnum;

use crate::board::Cable;

/// Type of the emulated board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Model {
    /// NUCLEO-H743ZI2 with an STM32H743ZI, the default board.
    H743,
    /// NUCLEO-F446RE with an STM32F446RE.
    F446,
    /// ironbci with an STM32F407VE and one converter.
    Ironbci,
}

impl Model {
    /// Returns the fixed properties of this type of board, such as its name, clock rates, memories
    /// and pins.
    pub const fn facts(self) -> &'static Facts {
        match self {
            Self::H743 => &H743,
            Self::F446 => &F446,
            Self::Ironbci => &IRONBCI,
        }
    }

    /// Returns whether DMA1 can access the memory at `address` (RM0433, 2.1; RM0390, 2.1; RM0090,
    /// 2.1). On the STM32H743 it cannot access the tightly coupled memories (TCM).
    pub fn dma_reaches(self, address: u64) -> bool {
        let srams = self.facts().memories.iter();
        let mut srams = srams.filter(|(name, ..)| name.contains("SRAM"));
        srams.any(|&(_, start, size)| (start..start + size).contains(&address))
    }
}

/// Facts about a type of board and its microcontroller.
#[derive(Debug)]
pub struct Facts {
    /// Name by which the command line selects the board.
    pub key: &'static str,
    /// Name of the board in the device's message `Hello`.
    pub name: &'static str,
    /// Cable that the board's default image supports.
    pub default_cable: Cable,
    /// Frequency in Hz to which the firmware must set the core clock.
    pub core_hz: u64,
    /// Frequency in Hz of the core clock after a reset, when the internal oscillator supplies it
    /// (RM0433, 8.5.2; RM0390, 6.2.2).
    pub reset_hz: u64,
    /// Number of instructions that the emulated core completes per second of virtual time, above 0.
    /// It is assumed, not measured: about half an instruction per cycle, for code in flash with
    /// caches enabled. It affects when the firmware's results are ready, not what they are.
    pub instructions_per_second: u64,
    /// Name, first address and size in bytes of each of the chip's memories (DS12110 and DS10693,
    /// memory mapping). The STM32F446 and the STM32F407 are emulated as an STM32F427, which has
    /// more flash and RAM.
    pub(crate) memories: &'static [(&'static str, u64, u64)],
    /// Address of the boot loader's vector table (AN2606).
    pub(crate) loader_vectors: u32,
    /// Address of the registers of DMA1.
    pub(crate) dma: u64,
    pub(crate) pins: Pins,
}

const H743: Facts = Facts {
    key: "h743",
    name: "NUCLEO-H743ZI2",
    default_cable: Cable::Usb,
    core_hz: 480_000_000,
    reset_hz: 64_000_000,
    instructions_per_second: 250_000_000,
    memories: &[
        ("flash", 0x0800_0000, 2048 << 10),
        ("ITCM", 0x0000_0000, 64 << 10),
        ("DTCM", 0x2000_0000, 128 << 10),
        ("AXI SRAM", 0x2400_0000, 512 << 10),
        ("SRAM1 to 3", 0x3000_0000, 288 << 10),
    ],
    loader_vectors: 0x1FF0_9800,
    dma: 0x4002_0000,
    pins: Pins {
        sclk: Pin(A, 5),
        miso: Pin(A, 6),
        mosi: Pin(B, 5),
        selects: &pins(E, [2, 4, 5, 6, 9, 11, 13, 14]),
        start: Some(Pin(E, 10)),
        reset: Some(Pin(E, 12)),
        drdy: Pin(E, 7),
        trigger: Pin(B, 10),
        select_port: 0x5802_1000,
        spi: 0x4001_3000,
    },
};

const F446: Facts = Facts {
    key: "f446",
    name: "NUCLEO-F446RE",
    default_cable: Cable::Uart,
    core_hz: 168_000_000,
    reset_hz: 16_000_000,
    instructions_per_second: 103_000_000,
    memories: &[("flash", 0x0800_0000, 512 << 10), ("SRAM", 0x2000_0000, 128 << 10)],
    loader_vectors: 0x1FFF_0000,
    dma: 0x4002_6000,
    pins: Pins {
        sclk: Pin(B, 13),
        miso: Pin(B, 14),
        mosi: Pin(B, 15),
        selects: &pins(C, [0, 1, 2, 3, 8, 9, 10, 11]),
        start: Some(Pin(C, 6)),
        reset: Some(Pin(C, 12)),
        drdy: Pin(C, 7),
        trigger: Pin(B, 10),
        select_port: 0x4002_0800,
        spi: 0x4000_3800,
    },
};

const IRONBCI: Facts = Facts {
    key: "ironbci",
    name: "ironbci",
    pins: Pins {
        sclk: Pin(B, 3),
        miso: Pin(C, 11),
        mosi: Pin(B, 5),
        selects: &[Pin(D, 12)],
        start: None,
        reset: None,
        drdy: Pin(A, 9),
        trigger: Pin(B, 10),
        select_port: 0x4002_0C00,
        spi: 0x4000_3C00,
    },
    ..F446
};

impl fmt::Display for Model {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.facts().name)
    }
}

/// A pin: the index of its port, 0 for port A, and its number in the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pin(pub(crate) u8, pub(crate) u8);

impl Pin {
    pub(crate) const fn port(self) -> usize {
        self.0 as usize
    }
}

const fn pins(port: u8, numbers: [u8; 8]) -> [Pin; 8] {
    let mut pins = [Pin(port, 0); 8];
    let mut index = 0;
    while index < 8 {
        pins[index].1 = numbers[index];
        index += 1;
    }
    pins
}

impl fmt::Display for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "P{}{}", char::from(b'A' + self.0), self.1)
    }
}

/// Pins that connect a board to the converters and the trigger. They are copied from
/// `docs/hardware.md` and not from the firmware; a test compares them with that document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pins {
    pub(crate) sclk: Pin,
    pub(crate) miso: Pin,
    pub(crate) mosi: Pin,
    /// Chip selects of the converters, in the order of the chain.
    pub(crate) selects: &'static [Pin],
    /// Pin connected to the converters' START; `None` if the board ties START low.
    pub(crate) start: Option<Pin>,
    /// Pin connected to the converters' RESET; `None` if the board ties RESET high.
    pub(crate) reset: Option<Pin>,
    pub(crate) drdy: Pin,
    pub(crate) trigger: Pin,
    /// Base address of the GPIO port that drives the chip selects, START and RESET.
    pub(crate) select_port: u64,
    /// Base address of the SPI that the converters are connected to.
    pub(crate) spi: u64,
}

/// Indices of the GPIO ports with pins for the converters or the trigger.
const A: u8 = 0;
const B: u8 = 1;
const C: u8 = 2;
const D: u8 = 3;
const E: u8 = 4;

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the signal and the pin in each row of a board's table in docs/hardware.md.
    fn documented(model: Model) -> Vec<(String, String)> {
        let text = include_str!("../../../docs/hardware.md");
        let heading = format!("### {model}");
        let section = text.split(&heading).nth(1).expect("a section for the board");
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
    fn the_pins_are_those_of_the_documentation() {
        for model in [Model::H743, Model::F446, Model::Ironbci] {
            let pins = model.facts().pins;
            let mut wires: Vec<(String, Pin)> =
                (0..).zip(pins.selects).map(|(chip, pin)| (format!("CS {chip}"), *pin)).collect();
            let others = [
                ("START", pins.start),
                ("RESET", pins.reset),
                ("DRDY", Some(pins.drdy)),
                ("TRIGGER", Some(pins.trigger)),
                ("SCLK", Some(pins.sclk)),
                ("MISO", Some(pins.miso)),
                ("MOSI", Some(pins.mosi)),
            ];
            let others = others.into_iter();
            wires.extend(others.filter_map(|(name, pin)| Some((name.to_owned(), pin?))));
            let documented = documented(model);
            for (signal, pin) in wires {
                let row = documented.iter().find(|(name, _)| *name == signal);
                let name = row.map(|(_, pin)| pin.as_str());
                assert_eq!(name, Some(pin.to_string().as_str()), "{model}: {signal}");
            }
        }
    }
}
