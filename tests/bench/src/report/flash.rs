//! What an image loads into flash: its size, and the source locations of its panics.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use anyhow::ensure;
use emulator::EmulatorError;
use object::{Object, ObjectSegment};

/// End of the path of the one source file from which the firmware's tasks may panic. Embassy-sync's queue
/// asserts that it is not full when a slot is sent, and not empty when a slot is released. The tasks send and
/// release only slots that the queue has returned, so neither assertion fails.
const ALLOWED: &str = "src/zerocopy_channel.rs";

/// Last characters of every source file's name, by which the names are found in the image.
const SOURCE: &str = ".rs";

/// Reads the bytes that an image loads into flash: instructions, constants and initial values of variables.
///
/// # Errors
/// The file cannot be read, or is not an ELF file with segments.
pub(crate) fn loaded(image: &Path) -> anyhow::Result<Vec<u8>> {
    let file = fs::read(image).map_err(EmulatorError::file(image))?;
    let file = object::File::parse(&*file)?;
    let mut contents = Vec::new();
    for segment in file.segments() {
        contents.extend(segment.data()?);
    }
    ensure!(!contents.is_empty(), "{} loads no segment", image.display());
    Ok(contents)
}

/// Checks that [`ALLOWED`] is the only source file with a reachable panic, in an image that keeps the source
/// locations of its panics.
///
/// # Errors
/// Another source file has a reachable panic. Or not even [`ALLOWED`] is found, which means that the image
/// does not keep the locations.
pub(crate) fn check_panics(loaded: &[u8]) -> anyhow::Result<()> {
    let (allowed, others): (Vec<_>, Vec<_>) = source_files(loaded)
        .into_iter()
        .partition(|file| file.ends_with(ALLOWED));
    let others = others.join(", ");
    ensure!(
        others.is_empty(),
        "acquire or encode can panic in {others}\n  next: make the condition impossible for the compiler \
         (`get`, `zip`, NonZero), or handle it; `tests/bench/src/bin/tasks.rs` shows what the image contains"
    );
    ensure!(
        !allowed.is_empty(),
        "not even {ALLOWED} is there: the image does not keep the locations of its panics\n  \
         next: compare with `git log` of tests/bench/src/bin/tasks.rs"
    );
    Ok(())
}

/// Returns the names of all source files that occur in the loaded bytes.
fn source_files(loaded: &[u8]) -> BTreeSet<String> {
    let mut files = BTreeSet::new();
    for text in loaded.split(|byte| !byte.is_ascii_graphic()) {
        // Names can follow each other without a separator, so each is cut after its `.rs`.
        for name in String::from_utf8_lossy(text).split_inclusive(SOURCE) {
            if name.ends_with(SOURCE) {
                files.insert(name.to_owned());
            }
        }
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_outside_the_queue_and_a_check_without_locations_are_faults() {
        let queue = b"\0\x01/registry/embassy-sync-0.8.0/src/zerocopy_channel.rs\0";
        check_panics(queue).expect("the queue's panics are allowed");
        let ours = [&queue[..], b"firmware/src/timing.rs\0"].concat();
        for (loaded, words) in [
            (&ours[..], "can panic in firmware/src/timing.rs\n"),
            (
                b"a/src/zerocopy_channel.rsb/src/x.rsc",
                "can panic in b/src/x.rs\n",
            ),
            (b"no names", "not even "),
        ] {
            let why = check_panics(loaded).expect_err(words).to_string();
            assert!(why.contains(words), "{why}");
        }
    }
}
