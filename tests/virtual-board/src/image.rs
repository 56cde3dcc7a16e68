//! Firmware images (the ELF files that `cargo flash` writes to a board), and a replacement for the
//! boot loader in the chip's ROM: a vector table and an endless loop.

use std::fs;
use std::path::{Path, PathBuf};

use object::{Object, ObjectSection, ObjectSegment, ObjectSymbol};
use thiserror::Error;

use crate::model::Model;

/// A firmware image that has been checked to fit its board.
#[derive(Clone, Debug)]
pub struct Image {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Address, size in bytes and mangled name of each function, sorted by address.
    functions: Vec<(u64, u64, String)>,
    symbols: Vec<(String, u64)>,
}

/// Reason why an image cannot run on a board, and the command that builds the right image.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct ImageError(String);

/// Machine code of the Thumb instruction `b .`, a branch to itself.
pub(crate) const LOOP: u16 = 0xE7FE;

fn build_command(model: Model) -> String {
    format!(
        "cargo build --package board-{} --profile firmware --target thumbv7em-none-eabihf",
        model.facts().key
    )
}

impl Image {
    /// Reads an image and checks that it fits the board `model`.
    ///
    /// # Errors
    /// The file cannot be read, is older than one of its sources, is not an ELF file for ARM, or
    /// has a segment outside the memories of the chip.
    pub fn read(path: &Path, model: Model) -> Result<Self, ImageError> {
        let (name, build) = (path.display(), build_command(model));
        let bytes = fs::read(path).map_err(|error| {
            ImageError(format!("cannot read the image {name}: {error}; build it with `{build}`"))
        })?;
        if let Some(newer) = newer_source(path) {
            return Err(ImageError(format!(
                "{name} is older than {}, which it is built from; build it again with `{build}`",
                newer.display()
            )));
        }
        let is_arm = |file: &object::File<'_>| file.architecture() == object::Architecture::Arm;
        let parsed = match object::File::parse(&*bytes) {
            Ok(file) if is_arm(&file) => Ok(file),
            Ok(file) => Err(format!("it is for {:?}", file.architecture())),
            Err(error) => Err(error.to_string()),
        };
        let file = parsed.map_err(|why| {
            ImageError(format!(
                "{name} is no 32-bit ELF file for ARM ({why}); build it with `{build}`"
            ))
        })?;
        for segment in file.segments() {
            let (address, bytes) = (segment.address(), segment.size());
            let fits = |&(_, origin, length): &(&str, u64, u64)| {
                address >= origin && address + bytes <= origin + length
            };
            if bytes > 0 && !model.facts().memories.iter().any(fits) {
                return Err(ImageError(format!(
                    "{name} is not for the {model}: it places {bytes} bytes at {address:#010x}, where \
                     the chip has no memory; build the board's own image with `{build}`"
                )));
            }
        }
        let mut functions: Vec<_> = file
            .symbols()
            .filter(|symbol| symbol.kind() == object::SymbolKind::Text)
            .filter_map(|symbol| Some((symbol.address() & !1, symbol.size(), symbol.name().ok()?)))
            .map(|(address, size, name)| (address, size, name.to_owned()))
            .collect();
        functions.sort();
        let symbols = file
            .symbols()
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address())))
            .collect();
        Ok(Self { path: path.to_path_buf(), bytes, functions, symbols })
    }

    /// Returns the path from which the image was read.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the contents of the ELF file.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the address of the symbol `name`, without the Thumb bit if the symbol is a function.
    pub fn address(&self, name: &str) -> Option<u64> {
        let found = self.symbols.iter().find(|(symbol, _)| symbol == name);
        found.map(|(_, address)| address & !1)
    }

    /// Returns the address of the first function whose mangled name contains all of `words`.
    pub fn find_function(&self, words: &[&str]) -> Option<u64> {
        let mut functions = self.functions.iter();
        let found = functions.find(|(_, _, name)| words.iter().all(|word| name.contains(word)));
        found.map(|(address, _, _)| *address)
    }

    /// Returns the address of the first halfword in the section `.text` that has the value `code`.
    pub(crate) fn find_instruction(&self, code: u16) -> Option<u64> {
        let file = object::File::parse(&*self.bytes).ok()?;
        let text = file.section_by_name(".text")?;
        let bytes = text.data().ok()?;
        let (halves, _) = bytes.as_chunks::<2>();
        let place = halves.iter().position(|half| *half == code.to_le_bytes())?;
        Some(text.address() + 2 * place as u64)
    }

    /// Returns the address of a function in `core` that panics, and the number of the register in
    /// which it expects its argument of type `&Location`. Every image that unwraps an `Option`
    /// contains one.
    pub(crate) fn panic_function(&self) -> Option<(u64, usize)> {
        let functions: [(&[&str], usize); 3] = [
            (&["4core", "6option", "13unwrap_failed"], 0),
            (&["4core", "panicking", "panic_const"], 0),
            (&["4core", "6option", "13expect_failed"], 2),
        ];
        let mut found = functions.iter();
        found.find_map(|(words, register)| Some((self.find_function(words)?, *register)))
    }

    /// Formats an address with the function that contains it and the offset from the function's
    /// start; only the address if no function does.
    pub fn describe(&self, address: u64) -> String {
        let after = self.functions.partition_point(|(start, _, _)| *start <= address);
        let found = after.checked_sub(1).and_then(|index| self.functions.get(index));
        match found {
            Some((start, size, name)) if address < start + size.max(&1) => {
                format!("{address:#010x} {}+{:#x}", readable(name), address - start)
            }
            _ => format!("{address:#010x}"),
        }
    }
}

/// Returns the first source file that is newer than the image, if any. Cargo lists the sources in a
/// `.d` file next to the image; without that file, returns `None`.
fn newer_source(image: &Path) -> Option<PathBuf> {
    let built = fs::metadata(image).and_then(|file| file.modified()).ok()?;
    let list = fs::read_to_string(image.with_extension("d")).ok()?;
    let (_, sources) = list.lines().next()?.split_once(": ")?;
    let is_newer = |source: &&str| {
        let modified = fs::metadata(source).and_then(|file| file.modified());
        modified.is_ok_and(|modified| modified > built)
    };
    sources.split(' ').find(is_newer).map(PathBuf::from)
}

/// Demangles a function's name and removes the hash at its end.
fn readable(name: &str) -> String {
    rustc_demangle::demangle(name).to_string().split("::h").next().unwrap_or(name).to_owned()
}

/// Value of the field `e_machine` in an ELF header for ARM.
const ARM: u16 = 40;

/// Length in bytes of an ELF header followed by one program header.
const HEADERS: u32 = 84;

/// Returns the replacement of the boot loader as an image for the emulator.
pub(crate) fn loader(model: Model) -> Option<rigless::image::Image> {
    let base = model.facts().loader_vectors;
    // Vector table of stack pointer and entry point, then twice the instruction [`LOOP`].
    let contents = [0x2000_1000, base + 9, 0xE7FE_E7FE].map(u32::to_le_bytes).concat();
    let file = elf(ARM, base, &contents);
    rigless::image::Image::new(Path::new("loader"), file, None).ok()
}

/// Returns an ELF file with one segment of `contents` at the address `base`. The third word of the
/// contents is the entry point (System V ABI, chapters 4 and 5). `machine` is the processor type,
/// 40 for ARM.
pub fn elf(machine: u16, base: u32, contents: &[u8]) -> Vec<u8> {
    let mut file = b"\x7fELF\x01\x01\x01".to_vec();
    file.resize(16, 0);
    // The type of the file is 2, an executable; the program header follows this ELF header.
    file.extend([2, machine].map(u16::to_le_bytes).concat());
    let header = [1, base + 9, 52, 0, 0x0500_0400];
    file.extend(header.map(u32::to_le_bytes).concat());
    file.extend([52_u16, 32, 1, 40, 0, 0].map(u16::to_le_bytes).concat());
    // The program header describes one segment that can be loaded, read and executed.
    let length = u32::try_from(contents.len()).unwrap_or(0);
    let segment = [1, HEADERS, base, base, length, length, 5, 4];
    file.extend(segment.map(u32::to_le_bytes).concat());
    file.extend(contents);
    file
}
