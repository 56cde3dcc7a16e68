//! Runs of the counting images, and the counts that they print.

use std::collections::BTreeMap;
use std::fmt::Display;
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

/// Virtual time per instruction as a power of two: 2^10 ns, as the images' instruction counter
/// expects.
const INSTRUCTION_TIME: u8 = 10;

/// Runs an image on these inputs in `folder`, and returns its printed lines and its output file.
///
/// # Errors
/// The image does not run to its end, the output has another length than expected, or a file cannot be used.
pub(crate) fn run(
    image: &Image,
    machine: Machine,
    folder: &Path,
    inputs: &[u8],
    expected: &[u8],
    progress: &ProgressBar,
) -> Result<(Vec<String>, Vec<u8>), Failure> {
    let path = folder.join(INPUTS);
    fs::write(&path, inputs).map_err(EmulatorError::file(&path))?;
    progress.set_message(machine.name);
    let lines = Qemu::new(image, machine, folder, &[])
        .instruction_time(INSTRUCTION_TIME)
        .uart(Uart::None)
        .run(SILENCE, |_| progress.inc(1))?;
    let path = folder.join(OUTPUTS);
    let output = fs::read(&path).map_err(EmulatorError::file(&path))?;
    let (length, wanted) = (output.len(), expected.len());
    if length != wanted {
        let why = format!("the output has {length} bytes, {wanted} expected");
        return Err(mismatch(machine, why));
    }
    Ok((lines, output))
}

/// Failure when the output of an image is not what this program expects; for `map_err`.
pub(crate) fn mismatch(machine: Machine, why: impl Display) -> Failure {
    Failure::new(
        format!("reading the counts of {}", machine.name),
        why,
        "is the image older than this program? `cargo clean --package bench`",
    )
}

/// Numbers that an image printed, keyed by the words before them on the line.
#[derive(Debug)]
pub(crate) struct Lines(BTreeMap<String, String>);

impl Lines {
    /// Splits lines into words and numbers: `count` and `step` end with a tally, all others with one number.
    pub(crate) fn parse(lines: &[String]) -> Result<Self, String> {
        let mut parsed = BTreeMap::new();
        for line in lines {
            let numbers = if line.starts_with("count ") || line.starts_with("step ") {
                3
            } else {
                1
            };
            let place = line.rmatch_indices(' ').nth(numbers - 1);
            let place = place.ok_or_else(|| format!("unknown: {line:?}"))?.0;
            let (words, numbers) = (line[..place].to_owned(), line[place + 1..].to_owned());
            if parsed.insert(words, numbers).is_some() {
                return Err(format!("{line:?} came twice"));
            }
        }
        Ok(Self(parsed))
    }

    /// Removes the line that starts with `words`, and parses the rest of it.
    pub(crate) fn remove<T>(
        &mut self,
        words: &str,
        parse: impl FnOnce(&str) -> Option<T>,
    ) -> Result<T, String> {
        let numbers = self.0.remove(words);
        let numbers = numbers.ok_or_else(|| format!("a line is missing: {words:?}"))?;
        parse(&numbers).ok_or_else(|| format!("the line {words:?} ends with {numbers:?}"))
    }

    /// Removes the line that starts with `words`, and parses the number at its end.
    pub(crate) fn number(&mut self, words: &str) -> Result<u32, String> {
        self.remove(words, |number| number.parse().ok())
    }

    /// Returns an error if the image printed a line that has not been removed.
    pub(crate) fn finish(self) -> Result<(), String> {
        match self.0.into_iter().next() {
            None => Ok(()),
            Some((words, numbers)) => Err(format!("unknown: {:?}", format!("{words} {numbers}"))),
        }
    }
}

/// For each input, one tally per column. A column is a contender, or a time step of a hop.
#[derive(Debug, Clone)]
pub(crate) struct Tallies(Vec<Vec<Tally>>);

impl Tallies {
    /// Removes the lines `KIND INPUT COLUMN FEWEST MOST TOTAL`.
    pub(crate) fn remove(
        lines: &mut Lines,
        kind: &str,
        inputs: usize,
        columns: &[impl Display],
    ) -> Result<Self, String> {
        let mut tally = |input, column| {
            let words = format!("{kind} {input} {column}");
            lines.remove(&words, Tally::parse)
        };
        let tallies = (0..inputs).map(|input| {
            let columns = columns.iter();
            columns.map(|column| tally(input, column)).collect()
        });
        Ok(Self(tallies.collect::<Result<_, _>>()?))
    }

    /// Returns the fewest and the most instructions of a column over all inputs.
    pub(crate) fn range(&self, column: usize) -> [u32; 2] {
        let tallies = || self.0.iter().map(|tallies| tallies[column]);
        let fewest = tallies().map(|tally| tally.fewest).min();
        let most = tallies().map(|tally| tally.most).max();
        [fewest.unwrap_or(0), most.unwrap_or(u32::MAX)]
    }

    /// Whether a column takes the same number of instructions for every input.
    ///
    /// Runs on one input can differ: the position in a ring buffer can affect the count, its contents must not.
    pub(crate) fn is_constant(&self, column: usize) -> bool {
        let mut tallies = self.0.iter().map(|tallies| tallies[column]);
        let first = tallies.next();
        tallies.all(|tally| Some(tally) == first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Tallies {
        /// Tallies of two inputs and these counts, of which one column can take one instruction more for the
        /// second input.
        pub(crate) fn of_two_inputs(counts: &[u32], varying: Option<usize>) -> Self {
            let tally = |input, column: usize| Tally {
                fewest: counts[column],
                most: counts[column] + u32::from(input == 1 && varying == Some(column)),
                total: 0,
            };
            let columns = 0..counts.len();
            let input = |input| columns.clone().map(|column| tally(input, column)).collect();
            Self([0, 1].map(input).to_vec())
        }
    }

    fn parsed(lines: &[&str]) -> Result<(Tallies, u32), String> {
        let lines: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
        let mut lines = Lines::parse(&lines)?;
        let tallies = Tallies::remove(&mut lines, "step", 2, &["a", "b"])?;
        let number = lines.number("kernel conv2, pool")?;
        lines.finish()?;
        Ok((tallies, number))
    }

    /// Lines of two inputs in any order; "b" takes one instruction more for the second input.
    const LINES: [&str; 5] = [
        "step 1 b 20 21 201",
        "step 1 a 10 11 21",
        "kernel conv2, pool 7",
        "step 0 a 10 11 21",
        "step 0 b 20 20 200",
    ];

    #[test]
    fn counts_are_read_in_any_order() {
        let (tallies, number) = parsed(&LINES).expect("the lines of an image");
        assert_eq!(number, 7);
        assert_eq!(
            [0, 1].map(|column| tallies.range(column)),
            [[10, 11], [20, 21]]
        );
    }

    #[test]
    fn one_instruction_more_on_one_input_is_not_constant() {
        let (tallies, _) = parsed(&LINES).expect("the lines of an image");
        assert_eq!(
            [0, 1].map(|column| tallies.is_constant(column)),
            [true, false]
        );
    }

    #[test]
    fn an_image_that_prints_something_else_is_refused() {
        for (line, words) in [
            ("step 2 a 1 1 256", "unknown: \"step 2 a 1 1 256\""),
            ("step 0 c 1 1 256", "unknown: \"step 0 c 1 1 256\""),
            ("step 0 a 1 1 1", "came twice"),
            ("kernel theirs 100", "theirs"),
            ("panicked at", "panicked at"),
            ("panicked", "panicked"),
        ] {
            let why = parsed(&[&LINES[..], &[line]].concat()).expect_err("broken");
            assert!(why.contains(words), "{why}");
        }
        for (place, words) in [(0, "step 1 b"), (2, "kernel conv2, pool"), (3, "step 0 a")] {
            let mut lines = LINES.to_vec();
            lines.remove(place);
            let why = parsed(&lines).expect_err("broken");
            assert_eq!(why, format!("a line is missing: {words:?}"));
        }
        let why = parsed(&["step 0 a 1 x 1"]).expect_err("broken");
        assert_eq!(why, "the line \"step 0 a\" ends with \"1 x 1\"");
    }
}
