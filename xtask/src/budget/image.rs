//! What an image says of itself: a 32-bit ELF file for ARM.

use std::fs;
use std::path::Path;

use object::LittleEndian;
use object::elf::{EM_ARM, FileHeader32, PF_X, PT_LOAD, SHF_ALLOC, SHT_SYMTAB};
use object::read::elf::{FileHeader as _, ProgramHeader as _, SectionHeader as _, Sym as _};

use crate::failure::Failure;

/// A piece of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Segment {
    /// Where it lies when the program runs.
    pub(crate) address: u64,
    /// Where it is flashed to.
    pub(crate) load_address: u64,
    /// Bytes that are flashed.
    pub(crate) file_size: u64,
    /// Bytes when the program runs.
    pub(crate) memory_size: u64,
    /// Its contents are instructions, or among them.
    pub(crate) executed: bool,
    /// Its first two words: of the vector table, stack and entry.
    pub(crate) first_words: [u32; 2],
}

/// A section that takes room when the program runs, or a symbol.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Named {
    /// Its name.
    pub(crate) name: String,
    /// Its address.
    pub(crate) address: u64,
    /// Its bytes.
    pub(crate) size: u64,
}

/// An image.
#[derive(Debug)]
pub(crate) struct Image {
    /// Its pieces that take room.
    pub(crate) segments: Vec<Segment>,
    /// Its sections that take room when the program runs.
    pub(crate) sections: Vec<Named>,
    /// Its symbols that have a name.
    pub(crate) symbols: Vec<Named>,
}

impl Image {
    /// Reads an image.
    ///
    /// # Errors
    /// The file cannot be read, or is no such image.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let failed = |why: String| Failure::Check {
            what: format!("reading the image {}", path.display()),
            why,
            next: "remove it and build it again; RUSTFLAGS must not be set".to_owned(),
        };
        let bytes = fs::read(path).map_err(|error| failed(error.to_string()))?;
        Self::parse(&bytes).ok_or_else(|| failed("this is no 32-bit ELF file for ARM".to_owned()))
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let header = FileHeader32::<LittleEndian>::parse(bytes).ok()?;
        let endian = header.endian().ok()?;
        if header.e_machine(endian) != EM_ARM {
            return None;
        }
        let segments = header.program_headers(endian, bytes).ok()?.iter();
        let segments = segments
            .filter(|segment| segment.p_type(endian) == PT_LOAD)
            .map(|segment| {
                let contents = segment.data(endian, bytes).ok()?;
                Some(Segment {
                    address: segment.p_vaddr(endian).into(),
                    load_address: segment.p_paddr(endian).into(),
                    file_size: segment.p_filesz(endian).into(),
                    memory_size: segment.p_memsz(endian).into(),
                    executed: segment.p_flags(endian) & PF_X != 0,
                    first_words: [0, 4].map(|at| word(contents, at).unwrap_or(0)),
                })
            })
            .collect::<Option<_>>()?;
        let table = header.sections(endian, bytes).ok()?;
        let text = |name: &[u8]| String::from_utf8_lossy(name).into_owned();
        let sections = table
            .iter()
            .filter(|section| section.sh_flags(endian) & SHF_ALLOC != 0)
            .filter(|section| section.sh_size(endian) > 0)
            .map(|section| {
                Some(Named {
                    name: text(table.section_name(endian, section).ok()?),
                    address: section.sh_addr(endian).into(),
                    size: section.sh_size(endian).into(),
                })
            })
            .collect::<Option<_>>()?;
        let symbols = table.symbols(endian, bytes, SHT_SYMTAB).ok()?;
        let symbols = symbols
            .iter()
            .map(|symbol| {
                Some(Named {
                    name: text(symbol.name(endian, symbols.strings()).ok()?),
                    address: symbol.st_value(endian).into(),
                    size: symbol.st_size(endian).into(),
                })
            })
            .filter(|symbol| symbol.as_ref().is_none_or(|symbol| !symbol.name.is_empty()))
            .collect::<Option<_>>()?;
        Some(Self {
            segments,
            sections,
            symbols,
        })
    }

    /// What is wrong with an image that shall start at `flash` with the stack's end behind `stack_start`.
    pub(crate) fn fault(&self, flash: u64, stack_start: u64) -> Option<String> {
        let Some(table) = self.segments.iter().find(|s| s.load_address == flash) else {
            return Some(format!("nothing lies at the flash's origin {flash:#010x}"));
        };
        if !self.segments.iter().any(|s| s.executed && s.file_size > 0) {
            return Some("it has no instructions".to_owned());
        }
        let [stack, entry] = table.first_words.map(u64::from);
        if stack != stack_start {
            return Some(format!(
                "its stack begins at {stack:#010x} instead of {stack_start:#010x}"
            ));
        }
        // Bit 0 says that it is thumb code.
        let executed = |s: &&Segment| s.executed;
        let mut places = self.segments.iter().filter(executed);
        let inside = places.any(|s| (s.address..s.address + s.file_size).contains(&entry));
        (entry % 2 == 0 || !inside).then(|| format!("its entry {entry:#010x} is no thumb code"))
    }
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Offsets in the file's header (System V ABI, chapter 4).
    const MACHINE: usize = 18;
    const PROGRAM_HEADERS: usize = 28;
    const HEADER_SIZE: usize = 42;
    const HEADER_COUNT: usize = 44;

    const FLASH_AT: u32 = 0x0800_0000;
    const STACK: u32 = 0x2000_8000;

    /// A header, one program header, then the vector table and a page of code.
    fn elf(machine: u16, words: [u32; 2]) -> Vec<u8> {
        let mut image = vec![0; 52];
        image[..7].copy_from_slice(b"\x7fELF\x01\x01\x01");
        image[MACHINE..MACHINE + 2].copy_from_slice(&machine.to_le_bytes());
        image[PROGRAM_HEADERS] = 52;
        image[HEADER_SIZE] = 32;
        image[HEADER_COUNT] = 1;
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
