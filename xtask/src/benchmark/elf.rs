//! How much flash an image takes.

use std::fs;
use std::path::Path;

use crate::failure::Failure;

/// Offsets in a header of a 32-bit ELF file, and in one of its program headers (System V ABI, chapters
/// 4 and 5).
const PROGRAM_HEADERS: usize = 28;
const HEADER_SIZE: usize = 42;
const HEADER_COUNT: usize = 44;
const FILE_OFFSET: usize = 4;
const FILE_SIZE: usize = 16;
/// A segment that is loaded.
const LOAD: u32 = 1;

/// Bytes that an image for a microcontroller puts into flash: instructions, constants, and what
/// variables start with.
///
/// # Errors
/// The file cannot be read, or is no such image.
pub(crate) fn flash_bytes(path: &Path) -> Result<usize, Failure> {
    let failed = |why: String| Failure::Check {
        what: format!("reading the image {}", path.display()),
        why,
        next: "`cargo clean --package bench` and run it again".to_owned(),
    };
    let image = fs::read(path).map_err(|error| failed(error.to_string()))?;
    loaded(&image).ok_or_else(|| failed("this is no 32-bit ELF file with segments".to_owned()))
}

/// What an image puts into flash.
pub(crate) fn contents(image: &[u8]) -> Option<Vec<u8>> {
    let mut contents = Vec::new();
    for header in headers(image)? {
        let begin = word(header, FILE_OFFSET)? as usize;
        let end = begin.checked_add(word(header, FILE_SIZE)? as usize)?;
        contents.extend(image.get(begin..end)?);
    }
    Some(contents)
}

/// The headers of all loaded segments.
fn headers(image: &[u8]) -> Option<impl Iterator<Item = &[u8]>> {
    // Magic number, 32 bits, little endian.
    if !image.starts_with(b"\x7fELF\x01\x01") {
        return None;
    }
    let first = word(image, PROGRAM_HEADERS)? as usize;
    let [size, count] = [HEADER_SIZE, HEADER_COUNT].map(|at| half_word(image, at));
    let headers = image.get(first..)?.chunks_exact(size?.max(1)).take(count?);
    Some(headers.filter(|header| word(header, 0) == Some(LOAD)))
}

/// Sum of the file sizes of all loaded segments.
fn loaded(image: &[u8]) -> Option<usize> {
    let bytes: usize = headers(image)?
        .map(|header| word(header, FILE_SIZE).map(|size| size as usize))
        .sum::<Option<_>>()?;
    (bytes > 0).then_some(bytes)
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn half_word(bytes: &[u8], at: usize) -> Option<usize> {
    let half = u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?);
    Some(half.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF header, then program headers of 32 bytes: type and size in the file.
    fn elf(segments: &[(u32, u32)]) -> Vec<u8> {
        let mut image = vec![0; 52];
        image[..6].copy_from_slice(b"\x7fELF\x01\x01");
        image[PROGRAM_HEADERS] = 52;
        image[HEADER_SIZE] = 32;
        image[HEADER_COUNT] = u8::try_from(segments.len()).expect("a few");
        for (kind, size) in segments {
            let mut header = [0; 32];
            header[..4].copy_from_slice(&kind.to_le_bytes());
            header[FILE_SIZE..FILE_SIZE + 4].copy_from_slice(&size.to_le_bytes());
            image.extend(header);
        }
        image
    }

    #[test]
    fn what_is_loaded_counts_and_notes_do_not() {
        assert_eq!(
            loaded(&elf(&[(LOAD, 1_000), (4, 77), (LOAD, 500)])),
            Some(1_500)
        );
    }

    #[test]
    fn what_is_no_image_has_no_size() {
        assert_eq!(loaded(b"#!/bin/sh"), None);
        assert_eq!(loaded(&elf(&[])), None);
        // A program header that the file ends before.
        assert_eq!(loaded(&elf(&[(LOAD, 1)])[..60]), None);
    }
}
