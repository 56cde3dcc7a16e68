//! Segments, sections and symbols of an image: a 32-bit ELF file for ARM.

use std::collections::BTreeMap;

use object::elf::SHF_ALLOC;
use object::read::elf::{ElfFile32, ProgramHeader as _};
use object::{
    Architecture, LittleEndian, Object as _, ObjectSection as _, ObjectSegment as _,
    ObjectSymbol as _, SectionFlags,
};

/// Segment of an image that is loaded into memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Segment {
    /// Address of the segment while the program runs.
    pub(crate) address: u64,
    /// Address in flash. It differs from `address` for variables, which the start-up code copies to
    /// RAM.
    pub(crate) load_address: u64,
    /// Number of bytes that the segment takes in flash.
    pub(crate) file_size: u64,
    /// Number of bytes in memory while the program runs; it includes variables that start at zero.
    pub(crate) memory_size: u64,
}

/// Parts of an image's ELF file from which the budget of flash and RAM is computed.
#[derive(Debug)]
pub(crate) struct Image {
    pub(crate) segments: Vec<Segment>,
    /// Name, address and size in bytes of each section that takes memory when the program runs.
    pub(crate) sections: Vec<(String, u64, u64)>,
    /// Address of each symbol, by name.
    pub(crate) symbols: BTreeMap<String, u64>,
}

impl Image {
    /// Parses `bytes`. Returns `None` if they are not a 32-bit ELF file for ARM.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let file = ElfFile32::<LittleEndian>::parse(bytes).ok()?;
        if file.architecture() != Architecture::Arm {
            return None;
        }
        let segments = file.segments().map(|segment| {
            let header = segment.elf_program_header();
            Segment {
                address: segment.address(),
                load_address: header.p_paddr(LittleEndian).into(),
                file_size: header.p_filesz(LittleEndian).into(),
                memory_size: segment.size(),
            }
        });
        let sections = file.sections().filter(|section| {
            let SectionFlags::Elf { sh_flags } = section.flags() else {
                return false;
            };
            section.size() > 0 && sh_flags & u64::from(SHF_ALLOC) != 0
        });
        let sections = sections.map(|section| {
            let name = section.name().ok()?.to_owned();
            Some((name, section.address(), section.size()))
        });
        let symbols = file.symbols();
        let symbols = symbols.map(|one| Some((one.name().ok()?.to_owned(), one.address())));
        Some(Self {
            segments: segments.collect(),
            sections: sections.collect::<Option<_>>()?,
            symbols: symbols.collect::<Option<_>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use object::elf::PT_LOAD;

    use super::*;

    /// Builds an ELF file for the machine with the ELF number `machine` (40 is ARM): a header, one
    /// program header and 256 bytes.
    fn elf(machine: u8) -> Vec<u8> {
        let mut image = vec![0; 52];
        image[..7].copy_from_slice(b"\x7fELF\x01\x01\x01");
        // Fields of the header: the machine, then offset, size and number of the program headers
        // (System V ABI, chapter 4).
        for (at, byte) in [(18, machine), (28, 52), (42, 32), (44, 1)] {
            image[at] = byte;
        }
        for field in [PT_LOAD, 84, 0x2000, 0x1000, 256, 512, 0, 4] {
            image.extend(field.to_le_bytes());
        }
        image.resize(84 + 256, 0);
        image
    }

    #[test]
    fn an_image_for_arm_is_read_and_what_is_for_another_machine_or_cut_is_none() {
        let expected =
            Segment { address: 0x2000, load_address: 0x1000, file_size: 256, memory_size: 512 };
        let image = Image::parse(&elf(40)).expect("an image");
        assert_eq!(image.segments, [expected]);
        for file in [&elf(62), &elf(40)[..40], b""] {
            assert!(Image::parse(file).is_none());
        }
    }
}
