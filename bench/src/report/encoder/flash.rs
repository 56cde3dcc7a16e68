//! What an image loads into flash: its size, and the source locations of its panics.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use emulator::EmulatorError;
use object::{Object, ObjectSegment};

use crate::report::failure::Failure;

/// The one source file whose panics the firmware's tasks can reach: embassy-sync's queue asserts that it is not
/// full when a slot is sent, and not empty when one is released. Both tasks do so only with a slot that the queue
/// has returned.
const ALLOWED: &str = "src/zerocopy_channel.rs";

/// Last bytes of every source file's name, by which the names are found in the image.
const SOURCE: &[u8] = b".rs";

/// Reads the bytes that an image loads into flash: instructions, constants and initial values of variables.
///
/// # Errors
/// The file cannot be read, or is not an ELF file with segments.
pub(crate) fn loaded(image: &Path) -> Result<Vec<u8>, Failure> {
    let file = fs::read(image).map_err(EmulatorError::file(image))?;
    segments(&file).map_err(|why| {
        let next = "`cargo clean --package bench` and run it again";
        Failure::new(format!("reading the image {}", image.display()), why, next)
    })
}

/// Returns the contents of all segments that are loaded.
fn segments(image: &[u8]) -> Result<Vec<u8>, String> {
    let file = object::File::parse(image).map_err(|error| error.to_string())?;
    let mut contents = Vec::new();
    for segment in file.segments() {
        contents.extend(segment.data().map_err(|error| error.to_string())?);
    }
    if contents.is_empty() {
        return Err("no segment is loaded".to_owned());
    }
    Ok(contents)
}

/// Checks that the queue contains the only reachable panics of an image that keeps its panics' locations.
///
/// # Errors
/// Another source file has a reachable panic, or no location is found, so that the check itself is broken.
pub(crate) fn check_panics(image: &Path) -> Result<(), Failure> {
    judge(&source_files(&loaded(image)?)).map_err(|why| {
        let next = "make the condition impossible for the compiler (`get`, `zip`, NonZero), or handle it; \
                    `bench/src/bin/tasks.rs` shows what the image contains";
        Failure::new(format!("the panics of {}", image.display()), why, next)
    })
}

fn judge(files: &BTreeSet<String>) -> Result<(), String> {
    let (allowed, others): (Vec<_>, Vec<_>) = files
        .iter()
        .map(String::as_str)
        .partition(|file| file.ends_with(ALLOWED));
    if !others.is_empty() {
        return Err(format!(
            "acquire or encode can panic in {}",
            others.join(", ")
        ));
    }
    if allowed.is_empty() {
        return Err(format!(
            "not even {ALLOWED} is there: the image does not keep the locations of its panics"
        ));
    }
    Ok(())
}

/// Returns the names of source files among the loaded bytes.
fn source_files(loaded: &[u8]) -> BTreeSet<String> {
    let ends = loaded
        .windows(SOURCE.len())
        .enumerate()
        .filter(|(_, word)| *word == SOURCE)
        .map(|(at, _)| at + SOURCE.len());
    let name = |end: usize| {
        let path = loaded[..end]
            .rsplit(|byte| !byte.is_ascii_graphic())
            .next()?;
        // Constants can be adjacent: keep only the last name.
        let path = String::from_utf8_lossy(path).into_owned();
        let start = path[..path.len() - SOURCE.len()].rfind(".rs");
        Some(path[start.map_or(0, |start| start + SOURCE.len())..].to_owned())
    };
    ends.filter_map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ELF file of a 32-bit microcontroller with program headers of these types and contents.
    fn elf(contents: &[(u32, &[u8])]) -> Vec<u8> {
        let mut image = b"\x7fELF\x01\x01\x01".to_vec();
        image.resize(52, 0);
        for (at, half_word) in [(16, 2_u16), (18, 40), (20, 1), (40, 52), (42, 32)] {
            image[at..at + 2].copy_from_slice(&half_word.to_le_bytes());
        }
        image[28] = 52;
        image[44] = u8::try_from(contents.len()).expect("a few");
        let mut offset = 52 + 32 * contents.len();
        for (kind, bytes) in contents {
            let words = [*kind as usize, offset, 0, 0, bytes.len(), bytes.len(), 0, 0];
            for word in words {
                image.extend(u32::try_from(word).expect("32 bits").to_le_bytes());
            }
            offset += bytes.len();
        }
        image.extend(contents.iter().flat_map(|(_, bytes)| *bytes));
        image
    }

    #[test]
    fn loaded_segments_count_and_notes_do_not() {
        let image = elf(&[(1, b"code"), (4, b"a note"), (1, b"data")]);
        assert_eq!(segments(&image).as_deref(), Ok(&b"codedata"[..]));
    }

    #[test]
    fn what_is_not_an_image_is_refused() {
        assert!(segments(b"#!/bin/sh").is_err());
        assert!(segments(&elf(&[])).is_err());
        // The file ends before the contents of its segment.
        let image = elf(&[(1, b"code")]);
        assert!(segments(&image[..image.len() - 1]).is_err());
    }

    #[test]
    fn a_panic_outside_the_queue_and_a_check_without_locations_are_faults() {
        let judged = |loaded: &[u8]| judge(&source_files(loaded));
        let queue = b"\0\x01/registry/embassy-sync-0.8.0/src/zerocopy_channel.rs\0";
        assert_eq!(judged(queue), Ok(()));
        let ours = [&queue[..], b"firmware/src/timing.rs\0"].concat();
        let found = judged(&ours);
        assert!(
            found
                .as_ref()
                .is_err_and(|why| why.ends_with("firmware/src/timing.rs")),
            "{found:?}"
        );
        let adjacent = b"a/src/zerocopy_channel.rsb/src/x.rsc";
        assert!(judged(adjacent).is_err_and(|why| why.ends_with("in b/src/x.rs")));
        assert!(judged(b"no names").is_err_and(|why| why.starts_with("not even")));
    }
}
