//! What each board's image may take.

/// A board, and what its image may take of each region of its memory map.
#[derive(Debug)]
pub(crate) struct Limits {
    /// Its package.
    pub(crate) package: &'static str,
    /// Its name.
    pub(crate) name: &'static str,
    /// Its memory map, below the root.
    pub(crate) memory_map: &'static str,
    /// Region and bytes.
    pub(crate) regions: &'static [(&'static str, u64)],
    /// The least that the stack must have, bytes.
    pub(crate) stack: u64,
}

/// Regions that an image is loaded into, or that its variables lie in.
pub(crate) const FLASH: &str = "FLASH";
/// The stack's region.
pub(crate) const STACK: &str = "STACK";

/// All boards.
pub(crate) const BOARDS: [Limits; 2] = [
    Limits {
        package: "board-h743",
        name: "NUCLEO-H743ZI2",
        memory_map: "firmware/board-h743/stm32h743.x",
        // A quarter more flash and a sixteenth more RAM than was measured (523 and 85 KB, with
        // USB); half of the DMA's region is for what comes. Nothing lies in the ITCM (decision 0015).
        regions: &[
            (FLASH, 640 * 1024),
            ("ITCM", 0),
            ("RAM", 88 * 1024),
            ("SRAM1", 64 * 1024),
        ],
        stack: 32 * 1024,
    },
    Limits {
        package: "board-f446",
        name: "NUCLEO-F446RE",
        memory_map: "firmware/board-f446/stm32f446.x",
        // A seventieth more flash and a fourteenth more RAM than was measured (492 and 84 KB, with
        // the UART): there is little.
        regions: &[(FLASH, 488 * 1024), ("RAM", 88 * 1024)],
        stack: 32 * 1024,
    },
];
