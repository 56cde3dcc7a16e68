//! Limits on the memory that each board's image takes.

/// A board, and the limits on the memory that its images take.
#[derive(Debug)]
pub(crate) struct Limits {
    /// Name of the board in the printed table.
    pub(crate) name: &'static str,
    /// Names of the board's image files without ".elf". The limits apply to the first image.
    pub(crate) images: &'static [&'static str],
    /// Whether the first image is the board's default image.
    pub(crate) is_default: bool,
    /// Path of the linker's memory map, relative to the repository's root.
    pub(crate) memory_map: &'static str,
    /// Largest number of bytes that the image may take in each region; in other regions it may take
    /// none.
    pub(crate) regions: &'static [(&'static str, u64)],
    /// Smallest permitted size of the stack, bytes.
    pub(crate) stack: u64,
}

pub(crate) const BOARDS: [Limits; 4] = [
    Limits {
        name: "NUCLEO-H743ZI2",
        images: &["h743", "h743-uart", "kit-250", "kit-500", "cyton-16", "ten-twenty-32"],
        is_default: true,
        memory_map: "firmware/board-h743/stm32h743.x",
        // Limits for the image with USB: 9 % above the measured 660 KB of flash, 5 % above 92 KB of
        // RAM. The DMA may use half of SRAM1. The AXI SRAM holds the model slot, 258 KB. The ITCM
        // stays empty, because the kernels run from flash
        // (docs/decisions/0015-kernels-run-from-flash.md).
        regions: &[
            ("FLASH", 704 << 10),
            ("ITCM", 0),
            ("RAM", 94 << 10),
            ("AXI", 256 << 10),
            ("SRAM1", 64 << 10),
        ],
        stack: 32 << 10,
    },
    Limits {
        name: "NUCLEO-F446RE",
        images: &["f446", "f446-usb"],
        is_default: true,
        memory_map: "firmware/board-f446/stm32f446.x",
        // Limits for the image with the UART: 3 % above the measured 495 KB of flash, because the
        // chip has only 512 KiB; 5 % above 86 KB of RAM.
        regions: &[("FLASH", 496 << 10), ("RAM", 88 << 10)],
        stack: 32 << 10,
    },
    Limits {
        name: "NUCLEO-F446RE, packed code",
        images: &["f446-packed"],
        is_default: false,
        memory_map: "firmware/board-f446/stm32f446.x",
        // Limits: 3 % above the measured 258 KiB of flash, 1 % above the measured 76 KiB of RAM.
        regions: &[("FLASH", 266 << 10), ("RAM", 77 << 10)],
        stack: 32 << 10,
    },
    Limits {
        name: "ironbci",
        images: &["ironbci"],
        is_default: false,
        memory_map: "firmware/board-ironbci/stm32f407.x",
        // Limits: 5 % above the measured 178 KiB of flash, 9 % above the measured 40 KiB of RAM.
        regions: &[("FLASH", 187 << 10), ("RAM", 44 << 10)],
        stack: 32 << 10,
    },
];
