//! Memory that the DMA accesses.

use link::Streams;

use virtual_board::{BoardError, Cable};

use crate::images::Subject;
use crate::session::{assert_sound, run_codes, streaming};

/// Number of times that the DMA streams are inspected.
const INSPECTIONS: usize = 50;

/// Returns the number of DMA streams in use: two for SPI, and two more if the image uses the UART.
const fn streams(subject: Subject) -> usize {
    match subject.cable {
        Cable::Uart => 4,
        Cable::Usb => 2,
    }
}

/// All buffers of DMA streams are in memory that DMA1 can access. On the chip, DMA1 cannot access the DTCM
/// (RM0433, 2.1), but the emulator allows it.
pub(crate) fn dma_reaches_its_buffers(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 2)?;
    for _ in 0..INSPECTIONS {
        // The interval is not a multiple of the sample period, so the streams are inspected at
        // varying points.
        board.run_for_us(1_237)?;
        let memory = board.dma_memory()?;
        assert_eq!(memory.len(), streams(subject), "{memory:x?}");
        for (address, left) in memory {
            for end in [address, address + left.max(1) - 1] {
                assert!(
                    subject.model.dma_reaches(end),
                    "DMA1 cannot access {end:#010x}"
                );
            }
        }
    }
    assert_sound(&mut board)
}
