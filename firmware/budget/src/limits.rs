//! Limits on the memory that each board's image takes.

/// A board, and limits of its default image.
#[derive(Debug)]
pub(crate) struct Limits {
    /// Name of the board in the printed table.
    pub(crate) name: &'static str,
    /// Files of its images without ".elf"; the first is the default image, which the limits are for.
    pub(crate) images: [&'static str; 2],
    /// Path of the linker's memory map, relative to the repository's root.
    pub(crate) memory_map: &'static str,
    /// Most bytes that the image may take from each region; from other regions it may take none.
    pub(crate) regions: &'static [(&'static str, u64)],
    /// Least size of the stack, bytes.
    pub(crate) stack: u64,
}

pub(crate) const BOARDS: [Limits; 2] = [
    Limits {
        name: "NUCLEO-H743ZI2",
        images: ["h743", "h743-uart"],
        memory_map: "firmware/board-h743/stm32h743.x",
        // Flash: a quarter more than the measured 523 KB. RAM: a sixteenth more than the measured 85 KB. Both
        // were measured with USB. Half of the DMA's region is reserve. The ITCM stays empty (decision 0015).
        regions: &[
            ("FLASH", 640 << 10),
            ("ITCM", 0),
            ("RAM", 88 << 10),
            ("SRAM1", 64 << 10),
        ],
        stack: 32 << 10,
    },
    Limits {
        name: "NUCLEO-F446RE",
        images: ["f446", "f446-usb"],
        memory_map: "firmware/board-f446/stm32f446.x",
        // Flash: a seventieth more than the measured 492 KB. RAM: a fourteenth more than the measured 84 KB.
        // Both were measured with the UART. The chip has little to spare.
        regions: &[("FLASH", 488 << 10), ("RAM", 88 << 10)],
        stack: 32 << 10,
    },
];
