//! Microcontrollers that the image has to fit.

use serde::Serialize;

/// A part's memory, KiB of 1024 bytes.
#[derive(Debug, Clone, Copy)]
struct Part {
    name: &'static str,
    flash_kib: i64,
    /// The region that a program's variables and stack lie in.
    ram_kib: i64,
    region: &'static str,
}

/// From the data sheets' memory maps: DS10693 (STM32F446xC/E), DS8626 (STM32F405xx), DS12110
/// (STM32H743xI). The first is the smallest that must do.
const PARTS: [Part; 3] = [
    Part {
        name: "STM32F446RE",
        flash_kib: 512,
        ram_kib: 128,
        region: "SRAM1 and 2",
    },
    Part {
        name: "STM32F405RG",
        flash_kib: 1024,
        ram_kib: 128,
        region: "SRAM1 and 2, beside 64 KiB of CCM",
    },
    Part {
        name: "STM32H743ZI",
        flash_kib: 2048,
        ram_kib: 512,
        region: "AXI SRAM, beside 128 KiB of DTCM",
    },
];

/// What acquisition and encoder leave of a part, bytes.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct Room {
    pub(crate) part: &'static str,
    pub(crate) region: &'static str,
    pub(crate) flash_left: i64,
    /// For the stack, the link and the board.
    pub(crate) ram_left: i64,
}

impl Room {
    /// In each part.
    pub(crate) fn in_parts(flash_bytes: usize, ram_bytes: u32) -> [Self; PARTS.len()] {
        PARTS.map(|part| Self {
            part: part.name,
            region: part.region,
            flash_left: part.flash_kib * 1024 - i64::try_from(flash_bytes).unwrap_or(i64::MAX),
            ram_left: part.ram_kib * 1024 - i64::from(ram_bytes),
        })
    }

    /// In words, if there is none.
    pub(crate) fn fault(&self) -> Option<String> {
        let (part, flash, ram) = (self.part, self.flash_left, self.ram_left);
        (flash < 0 || ram < 0)
            .then(|| format!("{part} has too little: {flash} bytes of flash left, {ram} of RAM"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_byte_too_many_does_not_fit_the_smallest_part() {
        let faults = |flash, ram| {
            let rooms = Room::in_parts(flash, ram);
            rooms.iter().filter_map(Room::fault).collect::<Vec<_>>()
        };
        assert!(faults(512 * 1024, 128 * 1024).is_empty());
        assert_eq!(faults(512 * 1024 + 1, 0).len(), 1);
        let ram = faults(0, 128 * 1024 + 1);
        assert!(
            ram[0].contains("STM32F446RE") && ram[0].contains("-1 of RAM"),
            "{ram:?}"
        );
        assert_eq!(ram.len(), 2);
    }
}
