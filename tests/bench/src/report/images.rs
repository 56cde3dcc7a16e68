//! Runs images, reads the figures that they print, and reads the bytes that they load into flash.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, ensure};
use emulator::{EmulatorError, Image, Machine, Qemu, Uart};
use object::{Object, ObjectSegment};
use serde::de::DeserializeOwned;

use crate::block::{INPUTS, OUTPUTS};
use crate::tally::Tally;

/// Time limit for an image to print its next line; the longest time measured is 3 s.
const SILENCE: Duration = Duration::from_mins(2);

/// Exponent of the virtual time per instruction, 2^10 ns; the images' counter relies on this time.
const INSTRUCTION_TIME: u8 = 10;

/// Runs an image on `machine`, in `folder` within cargo's target folder, with `inputs` as its input
/// file. Returns the TOML counts that it prints, and its output file, which must have `length`
/// bytes.
///
/// # Errors
/// The image does not run to its end, its counts or its output file are not as expected, or a file
/// cannot be read or written.
pub(crate) fn run<T: DeserializeOwned>(
    image: &Image,
    machine: Machine,
    folder: &str,
    inputs: &[u8],
    length: usize,
) -> anyhow::Result<(T, Vec<u8>)> {
    eprintln!("counting on {}", machine.name);
    let folder = image.create_folder(Path::new(folder).join(machine.name))?;
    let path = folder.join(INPUTS);
    fs::write(&path, inputs).map_err(EmulatorError::file(&path))?;
    let lines = Qemu::new(image, machine, &folder, &[])
        .instruction_time(INSTRUCTION_TIME)
        .uart(Uart::None)
        .run(SILENCE, |_| ())?;
    let path = folder.join(OUTPUTS);
    let output = fs::read(&path).map_err(EmulatorError::file(&path))?;
    let next = "next: is the image older than this program? `cargo clean --package bench`";
    let found = output.len();
    ensure!(found == length, "the output has {found} bytes, {length} expected\n  {next}");
    let name = machine.name;
    let counts = toml::from_str(&lines.join("\n"));
    let counts = counts.with_context(|| format!("reading the counts of {name} failed\n  {next}"));
    Ok((counts?, output))
}

/// Returns an input file: first the number of time steps, which is the same for every input, then
/// `bytes`, the steps of all inputs.
pub(crate) fn with_steps(steps: usize, bytes: impl Iterator<Item = u8>) -> Vec<u8> {
    let steps = u32::try_from(steps).unwrap_or(u32::MAX).to_le_bytes();
    steps.into_iter().chain(bytes).collect()
}

/// Returns the number of blocks of `length` bytes in `output` that are not as in `expected`.
pub(crate) fn different(expected: &[u8], output: &[u8], length: usize) -> usize {
    let blocks = output.chunks(length).zip(expected.chunks(length));
    blocks.filter(|(block, expected)| block != expected).count()
}

/// Fewest and most instructions of one contender or one time step, over all inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Range {
    pub(crate) fewest: u32,
    pub(crate) most: u32,
    /// Whether every input takes the same number of instructions. Within one input, the number may
    /// vary with the position in a ring buffer; the contents of the buffer must not affect it.
    pub(crate) constant: bool,
}

impl Range {
    /// Returns the range of each of `columns` columns (a contender or a time step) over all inputs;
    /// `inputs` has one row of tallies for each input.
    ///
    /// # Errors
    /// A row has another number of tallies, or there is no row.
    pub(crate) fn of_columns(inputs: &[Vec<Tally>], columns: usize) -> anyhow::Result<Vec<Self>> {
        let is_complete = !inputs.is_empty() && inputs.iter().all(|row| row.len() == columns);
        ensure!(
            is_complete,
            "the image has not counted {columns} contenders or time steps for each input\n  \
             next: `cargo clean --package bench`"
        );
        let range = |column| Self::new(inputs.iter().map(|tallies| tallies[column]));
        Ok((0..columns).map(range).collect())
    }

    /// Returns the range over the tallies of all inputs.
    fn new(tallies: impl Iterator<Item = Tally> + Clone) -> Self {
        let first = tallies.clone().next();
        let fewest = tallies.clone().map(|tally| tally.fewest).min();
        let most = tallies.clone().map(|tally| tally.most).max();
        Self {
            fewest: fewest.unwrap_or(0),
            most: most.unwrap_or(u32::MAX),
            constant: tallies.map(Some).all(|tally| tally == first),
        }
    }
}

/// End of the path of the only source file from which the firmware's tasks may panic.
/// Embassy-sync's queue asserts that it is not full when a slot is sent, and not empty when a slot
/// is released. The tasks send and release only slots that the queue has returned, so neither
/// assertion fails.
const ALLOWED: &str = "src/zerocopy_channel.rs";

/// End of a source file's name, by which the names are found in the image.
const SOURCE: &str = ".rs";

/// Returns the bytes that an image loads into flash: instructions, constants and initial values of
/// variables.
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

/// Checks that [`ALLOWED`] is the only source file with a reachable panic. The image must keep the
/// source locations of its panics.
///
/// # Errors
/// Another source file has a reachable panic; or [`ALLOWED`] is not found either, which means that
/// the image does not keep the locations.
pub(crate) fn check_panics(loaded: &[u8]) -> anyhow::Result<()> {
    let (allowed, others): (Vec<_>, Vec<_>) =
        source_files(loaded).into_iter().partition(|file| file.ends_with(ALLOWED));
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

/// Returns the names of all source files that occur in the bytes of an image.
fn source_files(loaded: &[u8]) -> BTreeSet<String> {
    let mut files = BTreeSet::new();
    for text in loaded.split(|byte| !byte.is_ascii_graphic()) {
        // Names can follow each other without a separator, so cut after each `.rs`.
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
    fn one_instruction_more_on_one_input_is_not_constant() {
        let tally = |counts: [u32; 2]| {
            let mut tally = Tally::EMPTY;
            for count in counts {
                tally.add(count);
            }
            tally
        };
        let range = |fewest, most, constant| Range { fewest, most, constant };
        let inputs =
            [vec![tally([10, 11]), tally([20, 20])], vec![tally([10, 11]), tally([20, 21])]];
        assert_eq!(
            Range::of_columns(&inputs, 2).expect("two columns"),
            [range(10, 11, true), range(20, 21, false)]
        );
        // The largest counts of the two inputs are equal; only the smallest differ.
        let inputs = [vec![tally([10, 11])], vec![tally([11, 11])]];
        assert!(!Range::of_columns(&inputs, 1).expect("a column")[0].constant);
        let incomplete = [vec![tally([10, 11])], vec![]];
        assert!(Range::of_columns(&incomplete, 1).is_err());
    }

    #[test]
    fn a_single_bit_makes_one_block_different() {
        assert_eq!(different(&[0; 6], &[0, 0, 0, 0, 1, 0], 3), 1);
    }

    #[test]
    fn a_panic_outside_the_queue_and_a_check_without_locations_are_faults() {
        let queue = b"\0\x01/registry/embassy-sync-0.8.0/src/zerocopy_channel.rs\0";
        check_panics(queue).expect("the queue's panics are allowed");
        let ours = [&queue[..], b"firmware/src/timing.rs\0"].concat();
        for (loaded, words) in [
            (&ours[..], "can panic in firmware/src/timing.rs\n"),
            (b"a/src/zerocopy_channel.rsb/src/x.rsc", "can panic in b/src/x.rs\n"),
            (b"no names", "not even "),
        ] {
            let why = check_panics(loaded).expect_err(words).to_string();
            assert!(why.contains(words), "{why}");
        }
    }
}
