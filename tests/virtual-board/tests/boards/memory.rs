//! Where the DMA reads and writes.

use link::Streams;

use virtual_board::{Cable, Trouble};

use crate::images::Subject;
use crate::session::{assert_sound, run_codes, streaming};

/// How often the streams are looked at.
const LOOKS: usize = 50;

/// Streams in use: SPI in both directions, and the UART.
const fn streams(subject: Subject) -> usize {
    match subject.cable {
        Cable::Uart => 4,
        Cable::Usb => 2,
    }
}

/// What the DMA streams were given is in memories that they reach, looked at again and again. The emulator
/// itself lets a DMA reach the DTCM, which the chip does not (RM0433, 2.1).
pub(crate) fn dma_reaches_its_buffers(subject: Subject) -> Result<(), Trouble> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 2)?;
    for _ in 0..LOOKS {
        // No multiple of a sample's period.
        board.run_for_us(1_237)?;
        let memory = board.dma_memory()?;
        assert_eq!(memory.len(), streams(subject), "{memory:x?}");
        for (address, left) in memory {
            for end in [address, address + left.max(1) - 1] {
                assert!(
                    subject.model.dma_reaches(end),
                    "DMA1 does not reach {end:#010x}"
                );
            }
        }
    }
    assert_sound(&mut board)
}
