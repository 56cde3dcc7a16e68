//! Runs of the counting images, and the counts that they print.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs;
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use emulator::{EmulatorError, Image, Machine, Qemu, Uart};

use crate::block::{INPUTS, OUTPUTS};
use crate::tally::Tally;

/// Longest permitted silence of an image; measured 3 s on one loaded core.
const SILENCE: Duration = Duration::from_mins(2);

/// Virtual time per instruction as a power of two: 2^10 ns, as the images' instruction counter
/// expects.
const INSTRUCTION_TIME: u8 = 10;

/// Runs an image on these inputs in `folder` of cargo's target folder. Returns what `read` makes of the printed lines,
/// and the output file, which has `length` bytes.
///
/// # Errors
/// The image does not run to its end, its lines or its output are not the expected ones, or a file cannot be used.
pub(crate) fn run<T>(
    image: &Image,
    machine: Machine,
    folder: &str,
    inputs: &[u8],
    length: usize,
    read: impl FnOnce(&mut Lines) -> anyhow::Result<T>,
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
    let counts = Lines::read(&lines, read).and_then(|counts| {
        ensure!(
            output.len() == length,
            "the output has {} bytes, {length} expected",
            output.len()
        );
        Ok(counts)
    });
    let counts = counts.with_context(|| {
        format!(
            "reading the counts of {} failed\n  next: is the image older than this program? \
             `cargo clean --package bench`",
            machine.name
        )
    });
    Ok((counts?, output))
}

/// Lines `WORDS: NUMBERS` of an image, by their words.
#[derive(Debug)]
pub(crate) struct Lines(BTreeMap<String, String>);

impl Lines {
    /// Returns what `read` makes of the lines.
    ///
    /// # Errors
    /// `read` fails or does not take every line, or a line came twice or has another form.
    pub(crate) fn read<T>(
        lines: &[String],
        read: impl FnOnce(&mut Self) -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let mut parsed = BTreeMap::new();
        for line in lines {
            let (words, numbers) = line
                .split_once(": ")
                .with_context(|| format!("unknown: {line:?}"))?;
            let previous = parsed.insert(words.to_owned(), numbers.to_owned());
            ensure!(previous.is_none(), "{line:?} came twice");
        }
        let mut lines = Self(parsed);
        let value = read(&mut lines)?;
        if let Some((words, numbers)) = lines.0.pop_first() {
            bail!("unknown: {:?}", format!("{words}: {numbers}"));
        }
        Ok(value)
    }

    /// Takes the line with these words, and parses its numbers.
    pub(crate) fn take<T: FromStr>(&mut self, words: &str) -> anyhow::Result<T> {
        let numbers = self.0.remove(words);
        let numbers = numbers.with_context(|| format!("a line is missing: {words:?}"))?;
        let parsed = numbers.parse().ok();
        parsed.with_context(|| format!("the line {words:?} ends with {numbers:?}"))
    }

    /// Takes the lines `KIND INPUT COLUMN: FEWEST MOST TOTAL` of one column, one for each input.
    pub(crate) fn take_range(
        &mut self,
        kind: &str,
        inputs: usize,
        column: impl Display,
    ) -> anyhow::Result<Range> {
        let tallies = (0..inputs).map(|input| self.take(&format!("{kind} {input} {column}")));
        let tallies = tallies.collect::<anyhow::Result<Vec<Tally>>>()?;
        Ok(Range {
            fewest: tallies.iter().map(|tally| tally.fewest).min().unwrap_or(0),
            most: tallies
                .iter()
                .map(|tally| tally.most)
                .max()
                .unwrap_or(u32::MAX),
            constant: tallies.iter().all(|tally| *tally == tallies[0]),
        })
    }
}

/// Instructions of a contender, or of a time step of a hop, over all inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Range {
    pub(crate) fewest: u32,
    pub(crate) most: u32,
    /// Whether the number is the same for every input.
    ///
    /// Runs on one input can differ: the position in a ring buffer can affect the count, its contents must not.
    pub(crate) constant: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &[&str]) -> Result<([Range; 2], u32), String> {
        let lines: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
        let read = Lines::read(&lines, |lines| {
            let ranges = [
                lines.take_range("step", 2, "a")?,
                lines.take_range("step", 2, "b")?,
            ];
            Ok((ranges, lines.take("kernel conv2, pool")?))
        });
        read.map_err(|error| error.to_string())
    }

    /// Lines of two inputs in any order; "b" takes one instruction more for the second input.
    const LINES: [&str; 5] = [
        "step 1 b: 20 21 201",
        "step 1 a: 10 11 21",
        "kernel conv2, pool: 7",
        "step 0 a: 10 11 21",
        "step 0 b: 20 20 200",
    ];

    #[test]
    fn counts_are_read_in_any_order_and_one_instruction_more_on_one_input_is_not_constant() {
        let range = |fewest, most, constant| Range {
            fewest,
            most,
            constant,
        };
        assert_eq!(
            read(&LINES),
            Ok(([range(10, 11, true), range(20, 21, false)], 7))
        );
    }

    #[test]
    fn an_image_that_prints_something_else_is_refused() {
        for (line, words) in [
            ("step 2 a: 1 1 256", "unknown: \"step 2 a: 1 1 256\""),
            ("step 0 c: 1 1 256", "unknown: \"step 0 c: 1 1 256\""),
            ("step 0 a: 1 1 1", "came twice"),
            ("kernel theirs: 100", "theirs"),
            ("panicked", "panicked"),
        ] {
            let why = read(&[&LINES[..], &[line]].concat()).expect_err("broken");
            assert!(why.contains(words), "{why}");
        }
        for (place, words) in [(0, "step 1 b"), (2, "kernel conv2, pool"), (3, "step 0 a")] {
            let mut lines = LINES.to_vec();
            lines.remove(place);
            assert_eq!(read(&lines), Err(format!("a line is missing: {words:?}")));
        }
        for numbers in ["1 x 1", "1 1", "1 1 1 1"] {
            let why = read(&[&format!("step 0 a: {numbers}")]).expect_err("broken");
            assert_eq!(why, format!("the line \"step 0 a\" ends with {numbers:?}"));
        }
    }
}
