//! The packed code: its checksum, and its blocks for the samples of the other vectors.

use core::hint::black_box;

use model::{PACKED, PACKED_CHECKSUM};
use pipeline::{Mains, Rate};

use crate::{
    golden,
    mismatch::{Mismatch, expect_equal},
    path::Device,
    signal,
};

/// Compares the checksum that was computed at compile time with the checksum of the packed model in
/// flash.
pub(crate) fn check_sum() -> Result<(), Mismatch> {
    // `black_box` hides the contents from the compiler, so that the flash is read.
    let read = black_box(&PACKED).as_ref().map(model::Packed::checksum);
    let [expected, read] = [PACKED_CHECKSUM, read].map(Option::unwrap_or_default);
    expect_equal("sum", &[expected], &[read])
}

/// Restarts the device and compares its blocks for [`signal::samples`] with the golden ones, and
/// then its state. The rate changes with every block. The index of a mismatch counts the bytes of
/// all blocks.
pub(crate) fn check_blocks(device: &mut Device) -> Result<(), Mismatch> {
    device.acquisition.restart(Mains::Hz50);
    device.packed.restart();
    let mut samples = signal::samples();
    let mut bytes = 0;
    for (index, expected) in (0..).zip(&golden::BLOCKS) {
        device.packed.set_rate(rate(index));
        let block = samples.find_map(|sample| {
            let step = device.acquisition.process_sample(&sample)?;
            device.packed.encode_step(&step)
        });
        // Always made: the samples are endless.
        let made = block.as_ref().map_or(&[][..], |block| block.bytes());
        expect_equal("bytes", expected, made).map_err(|mismatch| mismatch.offset_by(bytes))?;
        bytes += made.len();
    }
    expect_equal("state", &golden::PACKED_STATE, device.packed.state())
}

/// Returns the rate of a block: 0 to 15, over and over.
pub(crate) fn rate(block: u8) -> Rate {
    Rate::new(block % 16).unwrap_or(Rate::MIDDLE)
}
