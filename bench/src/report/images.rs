//! Runs of the counting images, and their output.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use emulator::{EmulatorError, Image, Machine, Qemu, Uart};
use indicatif::ProgressBar;

use super::failure::Failure;
use crate::block::{INPUTS, OUTPUTS};
use crate::tally::Tally;

/// Longest permitted silence of an image; measured 3 s on one loaded core.
const SILENCE: Duration = Duration::from_mins(2);

/// Virtual time of an instruction is 2^10 ns, as the images' instruction counter expects.
const INSTRUCTION_TIME: u8 = 10;

/// Result of a run: printed counts, and the bytes of the output file.
#[derive(Debug)]
pub(crate) struct Output {
    pub(crate) counts: Counts,
    pub(crate) bytes: Vec<u8>,
}

/// Runs an image on these inputs in `folder`, and advances the progress bar with each printed line.
///
/// # Errors
/// The image does not run to its end, a line is malformed, or a file cannot be used.
pub(crate) fn run(
    image: &Image,
    machine: Machine,
    folder: &Path,
    inputs: &[u8],
    progress: &ProgressBar,
) -> Result<Output, Failure> {
    let path = folder.join(INPUTS);
    fs::write(&path, inputs).map_err(EmulatorError::file(&path))?;
    progress.set_message(machine.name);
    let lines = Qemu::new(image, machine, folder, &[])
        .instruction_time(INSTRUCTION_TIME)
        .uart(Uart::None)
        .run(SILENCE, |_| progress.inc(1))?;
    let path = folder.join(OUTPUTS);
    let bytes = fs::read(&path).map_err(EmulatorError::file(&path))?;
    let counts = Counts::parse(&lines).map_err(|why| mismatch(machine, why))?;
    Ok(Output { counts, bytes })
}

/// Failure when the output of an image is not what this program expects.
pub(crate) fn mismatch(machine: Machine, why: String) -> Failure {
    Failure::new(
        format!("reading the counts of {}", machine.name),
        why,
        "is the image older than this program? `cargo clean --package bench`",
    )
}

/// Counts that an image printed, by the words before them.
#[derive(Debug)]
pub(crate) struct Counts(BTreeMap<String, String>);

impl Counts {
    /// Parses lines of words and numbers: `count` and `step` end with a tally, all others with one number.
    pub(crate) fn parse(lines: &[String]) -> Result<Self, String> {
        let mut counts = BTreeMap::new();
        for line in lines {
            let words: Vec<&str> = line.split(' ').collect();
            let numbers = match words[0] {
                "count" | "step" => 3,
                _ => 1,
            };
            let (words, numbers) = words
                .split_at_checked(words.len().wrapping_sub(numbers))
                .ok_or_else(|| format!("the line {line:?}"))?;
            let [words, numbers] = [words, numbers].map(|words| words.join(" "));
            if counts.insert(words, numbers).is_some() {
                return Err(format!("{line:?} came twice"));
            }
        }
        Ok(Self(counts))
    }

    /// Removes and returns the numbers after these words.
    fn remove(&mut self, words: &str) -> Result<String, String> {
        let numbers = self.0.remove(words);
        numbers.ok_or_else(|| format!("a line is missing: {words:?}"))
    }

    /// Removes and returns the tally after these words.
    pub(crate) fn tally(&mut self, words: &str) -> Result<Tally, String> {
        let numbers = self.remove(words)?;
        Tally::parse(&numbers).ok_or_else(|| format!("the line {words:?} ends with {numbers:?}"))
    }

    /// Removes and returns the number after these words.
    pub(crate) fn number(&mut self, words: &str) -> Result<u32, String> {
        let number = self.remove(words)?;
        let parsed = number.parse();
        parsed.map_err(|_| format!("the line {words:?} ends with {number:?}"))
    }

    /// Checks that every line has been used.
    pub(crate) fn finish(self) -> Result<(), String> {
        match self.0.into_iter().next() {
            None => Ok(()),
            Some((words, numbers)) => Err(format!("unknown: {:?}", format!("{words} {numbers}"))),
        }
    }
}
