//! What each board's image may take.

/// A board, and limits of its default image.
#[derive(Debug)]
pub(crate) struct Limits {
    /// Name in the table.
    pub(crate) name: &'static str,
    /// Files of its images without ".elf"; the first is the default image, which the limits are for.
    pub(crate) images: [&'static str; 2],
    /// The linker's memory map, below the root.
    pub(crate) memory_map: &'static str,
    /// Most bytes of each region; none may be taken of other regions.
    pub(crate) regions: &'static [(&'static str, u64)],
    /// Least bytes of the stack.
    pub(crate) stack: u64,
}

pub(crate) const BOARDS: [Limits; 2] = [
    Limits {
        name: "NUCLEO-H743ZI2",
        images: ["h743", "h743-uart"],
        memory_map: "firmware/board-h743/stm32h743.x",
        // A quarter more flash and a sixteenth more RAM than measured (523 and 85 KB, with USB); half of the
        // DMA's region is reserve. The ITCM stays empty (decision 0015).
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
        // A seventieth more flash and a fourteenth more RAM than measured (492 and 84 KB, with the UART):
        // there is little.
        regions: &[("FLASH", 488 << 10), ("RAM", 88 << 10)],
        stack: 32 << 10,
    },
];
