//! Where the DMA reads and writes.

use link::Streams;

use crate::images::Subject;
use crate::session::{assert_sound, run_codes, streaming};

/// Every address that a DMA stream was given is in a memory that it reaches. The emulator itself lets a DMA
/// reach the DTCM, which the chip does not (RM0433, 2.1).
pub(crate) fn dma_reaches_its_buffers(subject: Subject) {
    let mut board = streaming(subject, Streams::CODES);
    run_codes(&mut board, 2).unwrap_or_else(|trouble| panic!("{trouble}"));
    let addresses = board.dma_addresses().expect("the board is there");
    assert!(
        addresses.len() >= 2,
        "SPI in both directions at least: {addresses:x?}"
    );
    for address in addresses {
        assert!(
            subject.model.dma_reaches(address),
            "DMA1 does not reach {address:#010x}"
        );
    }
    assert_sound(&mut board);
}
