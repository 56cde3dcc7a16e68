//! Firmware images as DfuSe files (`.dfu`), which `corticode-bridge update` and `dfu-util` read.
//!
//! ```text
//! ELF file ──xtask──► Image ──to_dfu──► corticode-h743.dfu ──from_dfu──► Image ──bridge──► flash
//! ```
//!
//! ST's manual UM0391 defines the format. The file has one target with one element. The target's
//! name describes the image: `NUCLEO-H743ZI2; firmware 0.1.0 5d4b736; model 2acfeb29e96e2dab`.
//!
//! ```
//! use dfuse::Image;
//!
//! let image = Image {
//!     board: "NUCLEO-H743ZI2".to_owned(),
//!     firmware: "0.1.0 5d4b736".to_owned(),
//!     model: "2acfeb29e96e2dab".to_owned(),
//!     address: 0x0800_0000,
//!     content: vec![1, 2, 3],
//! };
//! let file = image.to_dfu()?;
//! assert_eq!(Image::from_dfu(&file)?, image);
//! # Ok::<(), dfuse::DfuseError>(())
//! ```
#![forbid(unsafe_code)]

use crc::{CRC_32_JAMCRC, Crc};
use thiserror::Error;

/// USB vendor id of the loader in an STM32's ROM.
pub const VENDOR: u16 = 0x0483;
/// USB product id of the loader in an STM32's ROM.
pub const PRODUCT: u16 = 0xDF11;

/// Checksum over all preceding bytes (DFU 1.1, appendix B): CRC-32 without the final inversion.
const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_JAMCRC);
/// Length of the suffix at the end of a file, bytes.
const SUFFIX: usize = 16;
/// Length of everything before the content, bytes: the headers of file, target and element.
const HEADERS: u32 = 11 + 274 + 8;
/// Length of the zero-padded field with the target's name, bytes; at least one byte is zero.
const NAME: usize = 255;

/// A firmware image, with its version, and the board and model that it is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Name of the board, as the device's `Hello` message states it.
    pub board: String,
    /// Version and commit of the firmware, as the `Hello` message states them.
    pub firmware: String,
    /// Id of the model, 16 hexadecimal digits.
    pub model: String,
    /// Address of the first byte in flash.
    pub address: u32,
    /// Bytes to write to flash, from `address` on.
    pub content: Vec<u8>,
}

/// Why a file cannot be read as an image, or an image cannot be written as a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum DfuseError {
    /// The file does not end with the suffix of a DFU file.
    #[error("it is no DFU file, or its end is missing")]
    NoSuffix,
    /// The stated checksum differs from the checksum of the file's bytes.
    #[error("it is damaged: its checksum is wrong")]
    Checksum,
    /// The file is intact, but [`Image::to_dfu`] did not write it.
    #[error("it is a DFU file, but not of a Corticode image for an STM32")]
    Foreign,
    /// The target's name would be longer than 254 bytes, or the file longer than 4 GiB.
    #[error("board, version or content are too long for a DFU file")]
    TooLong,
}

impl Image {
    /// Returns the image as the bytes of a DfuSe file.
    ///
    /// # Errors
    ///
    /// [`DfuseError::TooLong`].
    pub fn to_dfu(&self) -> Result<Vec<u8>, DfuseError> {
        let Image { board, firmware, model, address, content } = self;
        let mut name = format!("{board}; firmware {firmware}; model {model}").into_bytes();
        let length = u32::try_from(content.len()).map_err(|_| DfuseError::TooLong)?;
        let size = length.checked_add(HEADERS).ok_or(DfuseError::TooLong)?;
        if name.len() >= NAME {
            return Err(DfuseError::TooLong);
        }
        name.resize(NAME, 0);
        let element = [address.to_le_bytes(), length.to_le_bytes()].concat();
        let target = [
            &b"Target\x00"[..],   // of alternate setting 0, which is the internal flash
            &1_u32.to_le_bytes(), // the target has a name
            &name,
            &(length + 8).to_le_bytes(),
            &1_u32.to_le_bytes(), // number of elements
            &element,
            content,
        ]
        .concat();
        let mut file = [&b"DfuSe\x01"[..], &size.to_le_bytes(), &[1], &target].concat();
        // The version 0xFFFF stands for any version of the device; 0x011A is DfuSe 1.1a.
        for field in [0xFFFF, PRODUCT, VENDOR, 0x011A] {
            file.extend(field.to_le_bytes());
        }
        file.extend(b"UFD\x10");
        file.extend(CHECKSUM.checksum(&file).to_le_bytes());
        Ok(file)
    }

    /// Reads an image from the bytes of a file.
    ///
    /// # Errors
    ///
    /// [`DfuseError::NoSuffix`], [`DfuseError::Checksum`] or [`DfuseError::Foreign`].
    pub fn from_dfu(file: &[u8]) -> Result<Image, DfuseError> {
        let (rest, checksum) = file.split_last_chunk::<4>().ok_or(DfuseError::NoSuffix)?;
        let (rest, signature) = rest.split_last_chunk::<4>().ok_or(DfuseError::NoSuffix)?;
        if signature != b"UFD\x10" {
            return Err(DfuseError::NoSuffix);
        }
        let covered = &file[..file.len() - checksum.len()];
        if CHECKSUM.checksum(covered) != u32::from_le_bytes(*checksum) {
            return Err(DfuseError::Checksum);
        }
        let parsed = rest.len().checked_sub(SUFFIX - 8).and_then(|end| {
            let (targets, suffix) = rest.split_at(end);
            let is_for_loader = suffix[2..6] == [0x11, 0xDF, 0x83, 0x04];
            is_for_loader.then(|| parse(targets))?
        });
        parsed.ok_or(DfuseError::Foreign)
    }
}

/// Parses the prefix and the target of a file whose suffix has been removed.
fn parse(file: &[u8]) -> Option<Image> {
    let mut rest = file;
    expect(&mut rest, b"DfuSe\x01")?;
    let size = number(&mut rest)?;
    expect(&mut rest, b"\x01Target\x00")?;
    let _is_named = number(&mut rest)?;
    let name = rest.split_off(..NAME)?;
    let target_size = number(&mut rest)?;
    let elements = number(&mut rest)?;
    let address = number(&mut rest)?;
    let length = number(&mut rest)?;
    let is_whole = [size, target_size, length].map(|size| usize::try_from(size).ok())
        == [file.len(), rest.len() + 8, rest.len()].map(Some);
    if elements != 1 || !is_whole {
        return None;
    }
    let name = std::str::from_utf8(name.split(|byte| *byte == 0).next()?).ok()?;
    let mut words = name.split("; ");
    let board = words.next()?.to_owned();
    let firmware = words.next()?.strip_prefix("firmware ")?.to_owned();
    let model = words.next()?.strip_prefix("model ")?.to_owned();
    Some(Image { board, firmware, model, address, content: rest.to_vec() })
}

fn expect(bytes: &mut &[u8], expected: &[u8]) -> Option<()> {
    let found = bytes.split_off(..expected.len())?;
    (found == expected).then_some(())
}

fn number(bytes: &mut &[u8]) -> Option<u32> {
    let (number, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(u32::from_le_bytes(*number))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> Image {
        Image {
            board: "NUCLEO-F446RE".to_owned(),
            firmware: "0.1.0 5d4b736+".to_owned(),
            model: "2acfeb29e96e2dab".to_owned(),
            address: 0x0800_0000,
            content: (0..=99).collect(),
        }
    }

    /// Returns the file with its checksum corrected.
    fn signed(mut file: Vec<u8>) -> Vec<u8> {
        file.truncate(file.len() - 4);
        file.extend(CHECKSUM.checksum(&file).to_le_bytes());
        file
    }

    #[test]
    fn a_file_has_the_fields_of_um0391_and_its_checksum_is_that_of_python() {
        let file = image().to_dfu().expect("a file");
        assert_eq!(file.len(), 11 + 274 + 8 + 100 + 16);
        assert_eq!(file[..11], *b"DfuSe\x01\x89\x01\0\0\x01");
        assert_eq!(file[11..35], *b"Target\0\x01\0\0\0NUCLEO-F446RE");
        assert_eq!(file[277..293], *b"\x6C\0\0\0\x01\0\0\0\0\0\0\x08\x64\0\0\0");
        assert_eq!(file[393..405], *b"\xFF\xFF\x11\xDF\x83\x04\x1A\x01UFD\x10");
        // Python: zlib.crc32(file[:-4]) ^ 0xFFFFFFFF
        assert_eq!(file[405..], 0x38B0_AD6B_u32.to_le_bytes());
    }

    #[test]
    fn no_file_that_was_cut_or_changed_is_accepted() {
        let file = image().to_dfu().expect("a file");
        for end in 0..file.len() {
            assert!(Image::from_dfu(&file[..end]).is_err(), "{end}");
        }
        for at in 0..file.len() {
            let mut file = file.clone();
            file[at] ^= 0x40;
            assert!(Image::from_dfu(&file).is_err(), "{at}");
        }
    }

    #[test]
    fn a_sound_file_of_something_else_is_foreign() {
        let file = image().to_dfu().expect("a file");
        let foreign = Err(DfuseError::Foreign);
        // Offsets of bytes in these fields, in turn: version, size, number of targets, name, number
        // of elements, length, USB product.
        for at in [5, 6, 10, 35, 281, 289, 395] {
            let mut file = file.clone();
            file[at] ^= 1;
            assert_eq!(Image::from_dfu(&signed(file)), foreign, "{at}");
        }
        let suffix_alone = signed(file[file.len() - SUFFIX..].to_vec());
        assert_eq!(Image::from_dfu(&suffix_alone), foreign);
        assert_eq!(Image::from_dfu(b"\x7fELF"), Err(DfuseError::NoSuffix));
        let board = "B".repeat(230);
        assert_eq!(Image { board, ..image() }.to_dfu(), Err(DfuseError::TooLong));
    }
}
