//! The image that `cargo flash` writes.

use std::path::{Path, PathBuf};
use std::{fs, io};

use object::{Object, ObjectSection, ObjectSegment, ObjectSymbol};
use thiserror::Error;

use crate::Model;

/// An image, checked against the board that it shall run on.
#[derive(Clone, Debug)]
pub struct Image {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Functions: address, size, name, by address.
    functions: Vec<(u64, u64, String)>,
    symbols: Vec<(String, u64)>,
}

/// Why an image cannot run on a board.
#[derive(Debug, Error)]
pub enum ImageError {
    /// The file cannot be read.
    #[error("cannot read the image {path}: {error}; build it with `{build}`")]
    Missing {
        /// The file.
        path: PathBuf,
        /// Why not.
        error: io::Error,
        /// The command that makes it.
        build: String,
    },
    /// The file is no program for this processor.
    #[error("{path} is no 32-bit ELF file for ARM ({why}); build it with `{build}`")]
    NoImage {
        /// The file.
        path: PathBuf,
        /// Why not.
        why: String,
        /// The command that makes it.
        build: String,
    },
    /// A source of the image is newer.
    #[error("{path} is older than {newer}, which it is built from; build it again with `{build}`")]
    Stale {
        /// The file.
        path: PathBuf,
        /// The source.
        newer: PathBuf,
        /// The command that makes it.
        build: String,
    },
    /// The file is linked for another chip's memories.
    #[error(
        "{path} is not for the {board}: it places {bytes} bytes at {address:#010x}, where the chip has no \
         memory; build the board's own image with `{build}`"
    )]
    OtherChip {
        /// The file.
        path: PathBuf,
        /// The board.
        board: &'static str,
        /// Where something is placed.
        address: u64,
        /// How many bytes.
        bytes: u64,
        /// The command that makes it.
        build: String,
    },
}

/// A branch to itself, in thumb.
pub(crate) const LOOP: u16 = 0xE7FE;

/// The command that builds a board's image.
fn build_command(model: Model) -> String {
    format!(
        "cargo build --package board-{} --profile firmware --target thumbv7em-none-eabihf",
        model.key()
    )
}

impl Image {
    /// Reads an image for a board.
    ///
    /// # Errors
    /// The file cannot be read, is older than a source of it, is no ELF file for ARM, or places something where
    /// the chip has no memory.
    pub fn read(path: &Path, model: Model) -> Result<Self, ImageError> {
        let path = path.to_path_buf();
        let build = build_command(model);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => return Err(ImageError::Missing { path, error, build }),
        };
        if let Some(newer) = newer_source(&path) {
            return Err(ImageError::Stale { path, newer, build });
        }
        Self::parse(path, bytes, model)
    }

    fn parse(path: PathBuf, bytes: Vec<u8>, model: Model) -> Result<Self, ImageError> {
        let build = build_command(model);
        let file = match object::File::parse(&*bytes) {
            Ok(file) if file.architecture() == object::Architecture::Arm => file,
            Ok(file) => {
                let why = format!("it is for {:?}", file.architecture());
                return Err(ImageError::NoImage { path, why, build });
            }
            Err(error) => {
                let why = error.to_string();
                return Err(ImageError::NoImage { path, why, build });
            }
        };
        for segment in file.segments() {
            let (address, bytes) = (segment.address(), segment.size());
            let fits = |&(_, origin, length): &(&str, u64, u64)| {
                address >= origin && address + bytes <= origin + length
            };
            if bytes > 0 && !model.memories().iter().any(fits) {
                let board = model.name();
                return Err(ImageError::OtherChip {
                    path,
                    board,
                    address,
                    bytes,
                    build,
                });
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
        Ok(Self {
            path,
            bytes,
            functions,
            symbols,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file's contents.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The address of a symbol; of a function without the bit that says thumb.
    pub fn address(&self, name: &str) -> Option<u64> {
        let found = self.symbols.iter().find(|(symbol, _)| symbol == name);
        found.map(|(_, address)| address & !1)
    }

    /// The address of the first function whose name contains all of these words.
    pub fn function(&self, words: &[&str]) -> Option<u64> {
        let mut functions = self.functions.iter();
        let found = functions.find(|(_, _, name)| words.iter().all(|word| name.contains(word)));
        found.map(|(address, _, _)| *address)
    }

    /// The address of the first instruction of 16 bits with this code.
    pub(crate) fn instruction(&self, code: u16) -> Option<u64> {
        let file = object::File::parse(&*self.bytes).ok()?;
        let text = file.section_by_name(".text")?;
        let bytes = text.data().ok()?;
        let (halves, _) = bytes.as_chunks::<2>();
        let place = halves.iter().position(|half| *half == code.to_le_bytes())?;
        Some(text.address() + 2 * place as u64)
    }

    /// A function that panics, and the register in which it takes the place of the panic: `core`'s own,
    /// which an image keeps where an `Option` or a result is unwrapped.
    pub(crate) fn panic(&self) -> Option<(u64, usize)> {
        let functions: [(&[&str], usize); 3] = [
            (&["4core", "6option", "13unwrap_failed"], 0),
            (&["4core", "panicking", "panic_const"], 0),
            (&["4core", "6option", "13expect_failed"], 2),
        ];
        let mut found = functions.iter();
        found.find_map(|(words, register)| Some((self.function(words)?, *register)))
    }

    /// The function at an address, with the distance from its beginning; the address alone where there is
    /// none.
    pub fn describe(&self, address: u64) -> String {
        let after = self
            .functions
            .partition_point(|(start, _, _)| *start <= address);
        let found = after
            .checked_sub(1)
            .and_then(|index| self.functions.get(index));
        match found {
            Some((start, size, name)) if address < start + size.max(&1) => {
                format!("{address:#010x} {}+{:#x}", readable(name), address - start)
            }
            _ => format!("{address:#010x}"),
        }
    }
}

/// A source that is newer than the image, by the list that cargo leaves next to it (`.d`); none without one.
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

/// A mangled name as its path, without the hash.
fn readable(name: &str) -> String {
    rustc_demangle::demangle(name)
        .to_string()
        .split("::h")
        .next()
        .unwrap_or(name)
        .to_owned()
}
