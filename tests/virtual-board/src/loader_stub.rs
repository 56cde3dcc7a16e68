//! Replacement for the boot loader in the chip's ROM: a vector table and an endless loop.

use std::path::Path;

use rigless::image::Image;

use crate::model::Model;

/// Thumb instruction `b .`, a branch to itself, in both halfwords.
const LOOP: u32 = 0xE7FE_E7FE;

/// Machine number of ARM in an ELF header.
const ARM: u16 = 40;

/// Size of an ELF header and one program header, in bytes.
const HEADERS: u32 = 84;

/// Returns the address of the boot loader's vector table (AN2606).
pub(crate) const fn vectors(model: Model) -> u32 {
    match model {
        Model::H743 => 0x1FF0_9800,
        Model::F446 => 0x1FFF_0000,
    }
}

/// Returns the replacement loader as an image for the emulator.
pub(crate) fn image(model: Model) -> Option<Image> {
    let base = vectors(model);
    // Initial stack pointer, entry point, and the loop.
    let contents = [0x2000_1000, base + 9, LOOP].map(u32::to_le_bytes).concat();
    let file = elf(ARM, base, &contents);
    Image::new(Path::new("loader"), file, None).ok()
}

/// Builds an ELF file with one segment of `contents` at address `base`. The entry point is the
/// third word of the segment (System V ABI, chapters 4 and 5). `machine` is 40 for ARM.
pub fn elf(machine: u16, base: u32, contents: &[u8]) -> Vec<u8> {
    let mut file = b"\x7fELF\x01\x01\x01".to_vec();
    file.resize(16, 0);
    // Type: executable. The program header follows this ELF header.
    file.extend([2, machine].map(u16::to_le_bytes).concat());
    let header = [1, base + 9, 52, 0, 0x0500_0400];
    file.extend(header.map(u32::to_le_bytes).concat());
    file.extend([52_u16, 32, 1, 40, 0, 0].map(u16::to_le_bytes).concat());
    // One segment: loadable, readable and executable.
    let length = u32::try_from(contents.len()).unwrap_or(0);
    let segment = [1, HEADERS, base, base, length, length, 5, 4];
    file.extend(segment.map(u32::to_le_bytes).concat());
    file.extend(contents);
    file
}
