//! Segments, sections and symbols of an image: a 32-bit ELF file for ARM.

use std::collections::BTreeMap;

use object::LittleEndian;
use object::elf::{EM_ARM, FileHeader32, PF_X, PT_LOAD, SHF_ALLOC};
use object::read::elf::{ElfFile32, FileHeader as _, ProgramHeader as _};
use object::{Object as _, ObjectSection as _, ObjectSymbol as _, SectionFlags};

/// Segment of an image that is loaded into memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment {
    /// Address when the program runs.
    pub(crate) address: u64,
    /// Address in flash.
    pub(crate) load_address: u64,
    /// Bytes in flash.
    pub(crate) file_size: u64,
    /// Bytes when the program runs.
    pub(crate) memory_size: u64,
    /// True if the segment contains instructions.
    pub(crate) executed: bool,
    /// First two words of the segment: in the vector table the initial stack pointer and the entry.
    pub(crate) first_words: [u32; 2],
}

/// A section that takes memory when the program runs: name, address, bytes.
#[derive(Debug)]
pub(crate) struct Section {
    pub(crate) name: String,
    pub(crate) address: u64,
    pub(crate) size: u64,
}

/// What the budget needs to know of an image.
#[derive(Debug)]
pub(crate) struct Image {
    pub(crate) segments: Vec<Segment>,
    pub(crate) sections: Vec<Section>,
    /// Address of each symbol, by name.
    pub(crate) symbols: BTreeMap<String, u64>,
}

impl Image {
    /// Parses an ELF file; `None` if it is not one for a 32-bit ARM.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let file = ElfFile32::<LittleEndian>::parse(bytes).ok()?;
        let header = FileHeader32::<LittleEndian>::parse(bytes).ok()?;
        let endian = header.endian().ok()?;
        if header.e_machine(endian) != EM_ARM {
            return None;
        }
        let headers = header.program_headers(endian, bytes).ok()?.iter();
        let loaded = headers.filter(|header| header.p_type(endian) == PT_LOAD);
        let segments = loaded.map(|header| {
            let contents = header.data(endian, bytes).ok()?;
            Some(Segment {
                address: header.p_vaddr(endian).into(),
                load_address: header.p_paddr(endian).into(),
                file_size: header.p_filesz(endian).into(),
                memory_size: header.p_memsz(endian).into(),
                executed: header.p_flags(endian) & PF_X != 0,
                first_words: [0, 4].map(|at| word(contents, at).unwrap_or(0)),
            })
        });
        let is_loaded = |flags| matches!(flags, SectionFlags::Elf { sh_flags } if sh_flags & u64::from(SHF_ALLOC) != 0);
        let sections = file
            .sections()
            .filter(|one| one.size() > 0 && is_loaded(one.flags()));
        let sections = sections.map(|section| {
            let (name, address, size) = (section.name().ok()?, section.address(), section.size());
            Some(Section {
                name: name.to_owned(),
                address,
                size,
            })
        });
        let symbols = file
            .symbols()
            .map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address())));
        Some(Self {
            segments: segments.collect::<Option<_>>()?,
            sections: sections.collect::<Option<_>>()?,
            symbols: symbols.collect::<Option<_>>()?,
        })
    }

    /// Returns what is wrong with an image that must start at `flash`, with its stack pointer at `stack_start`.
    pub(crate) fn fault(&self, flash: u64, stack_start: u64) -> Option<String> {
        let Some(table) = self.segments.iter().find(|s| s.load_address == flash) else {
            return Some(format!("nothing is at the flash's origin {flash:#010x}"));
        };
        let mut executed = self
            .segments
            .iter()
            .filter(|s| s.executed && s.file_size > 0)
            .peekable();
        let [stack, entry] = table.first_words.map(u64::from);
        if executed.peek().is_none() {
            return Some("it has no instructions".to_owned());
        }
        if stack != stack_start {
            return Some(format!(
                "its stack starts at {stack:#010x} instead of {stack_start:#010x}"
            ));
        }
        // Bit 0 of an address marks thumb code.
        let inside = executed.any(|s| (s.address..s.address + s.file_size).contains(&entry));
        (entry % 2 == 0 || !inside).then(|| format!("its entry {entry:#010x} is no thumb code"))
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLASH_AT: u32 = 0x0800_0000;
    const STACK: u32 = 0x2000_8000;

    /// Builds an ELF file: a header, one program header, then the vector table and a page of code.
    fn elf(machine: u8, words: [u32; 2]) -> Vec<u8> {
        let mut image = vec![0; 52];
        image[..7].copy_from_slice(b"\x7fELF\x01\x01\x01");
        // Machine, place, size and number of program headers (System V ABI, chapter 4).
        for (at, byte) in [(18, machine), (28, 52), (42, 32), (44, 1)] {
            image[at] = byte;
        }
        for field in [PT_LOAD, 84, FLASH_AT, FLASH_AT, 256, 256, PF_X, 4] {
            image.extend(field.to_le_bytes());
        }
        image.extend(words.into_iter().flat_map(u32::to_le_bytes));
        image.resize(84 + 256, 0);
        image
    }

    fn fault(words: [u32; 2], flash: u32) -> Option<String> {
        let image = Image::parse(&elf(40, words)).expect("an image");
        image.fault(flash.into(), STACK.into())
    }

    #[test]
    fn a_sound_image_has_no_fault_and_each_wrong_start_is_one() {
        let entry = FLASH_AT + 0x41;
        assert_eq!(fault([STACK, entry], FLASH_AT), None);
        assert!(fault([STACK + 8, entry], FLASH_AT).is_some_and(|why| why.contains("stack")));
        assert!(fault([STACK, entry + 1], FLASH_AT).is_some_and(|why| why.contains("entry")));
        assert!(fault([STACK, entry + 0x1000], FLASH_AT).is_some());
        assert!(fault([STACK, entry], FLASH_AT + 4).is_some_and(|why| why.contains("origin")));
    }

    #[test]
    fn what_is_for_another_machine_or_cut_is_no_image() {
        assert!(Image::parse(&elf(62, [0; 2])).is_none());
        assert!(Image::parse(&elf(40, [0; 2])[..40]).is_none());
        assert!(Image::parse(b"").is_none());
    }
}
