//! Runs the images that count instructions, and reads the counts that they print.

use std::fs;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, ensure};
use emulator::{EmulatorError, Image, Machine, Qemu, Uart};
use serde::de::DeserializeOwned;

use crate::block::{INPUTS, OUTPUTS};
use crate::tally::Tally;

/// Longest permitted time in which an image prints nothing; measured 3 s on one busy core.
const SILENCE: Duration = Duration::from_mins(2);

/// Virtual time per instruction: 2^10 ns, which the instruction counter in the images assumes.
const INSTRUCTION_TIME: u8 = 10;

/// Runs an image with `inputs` as its input file, in the subfolder `folder` of cargo's target folder. Returns
/// the counts that the image prints as TOML, and its output file, which must have `length` bytes.
///
/// # Errors
/// The image does not run to its end, its counts or its output file are not as expected, or a file cannot be
/// read or written.
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
    ensure!(
        found == length,
        "the output has {found} bytes, {length} expected\n  {next}"
    );
    let name = machine.name;
    let counts = toml::from_str(&lines.join("\n"));
    let counts = counts.with_context(|| format!("reading the counts of {name} failed\n  {next}"));
    Ok((counts?, output))
}

/// Number of instructions of a contender, or of a time step of a hop, over all inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Range {
    pub(crate) fewest: u32,
    pub(crate) most: u32,
    /// Whether the number is the same for every input.
    ///
    /// Runs on one input may differ, because the position in a ring buffer affects the count. The contents of
    /// the buffer must not.
    pub(crate) constant: bool,
}

impl Range {
    /// Returns the range of each column over all inputs; `inputs` has one row of tallies for each input.
    pub(crate) fn of_columns<const N: usize>(inputs: &[[Tally; N]]) -> [Self; N] {
        std::array::from_fn(|column| Self::new(inputs.iter().map(|tallies| tallies[column])))
    }

    /// Returns the range of the tallies of one contender or time step, one for each input.
    pub(crate) fn new(tallies: impl Iterator<Item = Tally> + Clone) -> Self {
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
        let range = |fewest, most, constant| Range {
            fewest,
            most,
            constant,
        };
        let inputs = [
            [tally([10, 11]), tally([20, 20])],
            [tally([10, 11]), tally([20, 21])],
        ];
        assert_eq!(
            Range::of_columns(&inputs),
            [range(10, 11, true), range(20, 21, false)]
        );
        // The largest counts are equal, the smallest are not.
        let inputs = [[tally([10, 11])], [tally([11, 11])]];
        assert!(!Range::of_columns(&inputs)[0].constant);
    }
}
