//! Counts of all contenders on one machine, and whether their outputs have the expected bits.

use emulator::Machine;
use fixed_dsp::BLOCK;
use model::ELECTRODES;

use crate::block::BYTES;
use crate::contenders::NAMES;
use crate::report::failure::Failure;
use crate::report::images::{Counts, Output, mismatch};
use crate::tally::Tally;

/// Index in [`NAMES`] of the contender whose output must equal that of the one before it.
const SINGLES: usize = 1;

/// Counts and comparison of one machine.
#[derive(Debug)]
pub(crate) struct Tallies {
    pub(crate) machine: Machine,
    /// Per input and contender.
    tallies: Vec<[Tally; NAMES.len()]>,
    /// Blocks of each contender whose bits differ from those of the portable filters.
    pub(crate) different: [usize; NAMES.len()],
}

impl Tallies {
    /// Reads the output of a run with `inputs` inputs.
    ///
    /// # Errors
    /// Lines or bytes are missing, or there are too many.
    pub(crate) fn new(
        machine: Machine,
        output: Output,
        inputs: usize,
        expected: &[u8],
    ) -> Result<Self, Failure> {
        let (length, wanted) = (output.bytes.len(), expected.len());
        if length != wanted {
            let why = format!("the output has {length} bytes, {wanted} expected");
            return Err(mismatch(machine, why));
        }
        let tallies = tallies(output.counts, inputs).map_err(|why| mismatch(machine, why))?;
        Ok(Self {
            machine,
            tallies,
            different: different(expected, &output.bytes),
        })
    }

    /// Returns the fewest and the most instructions per sample and electrode of one contender over all inputs.
    pub(crate) fn per_sample(&self, contender: usize) -> [f64; 2] {
        let tallies = || self.tallies.iter().map(|tallies| tallies[contender]);
        let samples = f64::from(u32::try_from(BLOCK * ELECTRODES).unwrap_or(u32::MAX));
        let fewest = tallies().map(|tally| tally.fewest).min();
        let most = tallies().map(|tally| tally.most).max();
        [fewest, most].map(|count| count.map_or(f64::NAN, f64::from) / samples)
    }

    /// Whether the contender takes the same number of instructions for every input.
    ///
    /// Blocks of one input can differ: the position in a ring buffer can affect the count, its samples must not.
    pub(crate) fn is_constant(&self, contender: usize) -> bool {
        let mut tallies = self.tallies.iter().map(|tallies| tallies[contender]);
        let first = tallies.next();
        tallies.all(|tally| Some(tally) == first)
    }
}

fn tallies(mut counts: Counts, inputs: usize) -> Result<Vec<[Tally; NAMES.len()]>, String> {
    let mut tallies = vec![[Tally::EMPTY; NAMES.len()]; inputs];
    for (input, tallies) in tallies.iter_mut().enumerate() {
        for (name, tally) in NAMES.iter().zip(tallies) {
            *tally = counts.tally(&format!("count {input} {name}"))?;
        }
    }
    counts.finish()?;
    Ok(tallies)
}

/// Counts the different blocks of each contender.
fn different(expected: &[u8], output: &[u8]) -> [usize; NAMES.len()] {
    let [expected, output] = [expected, output].map(|bytes| bytes.as_chunks::<BYTES>().0);
    let mut different = [0; NAMES.len()];
    for (index, block) in output.iter().enumerate() {
        let contender = index % NAMES.len();
        let twin = index - usize::from(contender == SINGLES);
        different[contender] += usize::from(expected[twin] != *block);
    }
    different
}

#[cfg(test)]
pub(crate) mod tests {
    use emulator::MACHINES;

    use super::*;

    /// Lines for two inputs; the count of each contender is its index plus 1000.
    fn lines() -> Vec<String> {
        let line = |input: u32, contender: usize| {
            let (name, count) = (NAMES[contender], 1000 + contender);
            format!("count {input} {name} {count} {count} {}", 256 * count)
        };
        let inputs = (0..2).flat_map(|input| (0..NAMES.len()).map(move |index| line(input, index)));
        inputs.collect()
    }

    fn parsed(lines: &[String]) -> Result<Tallies, String> {
        Ok(Tallies {
            machine: MACHINES[0],
            tallies: tallies(Counts::parse(lines)?, 2)?,
            different: [0; NAMES.len()],
        })
    }

    /// Tallies of equal counts on two inputs.
    pub(crate) fn sound() -> Tallies {
        parsed(&lines()).expect("the lines of an image")
    }

    /// Tallies of two inputs that differ for one contender.
    pub(crate) fn varying(contender: usize) -> Tallies {
        let mut tallies = sound();
        tallies.tallies[1][contender].most += 1;
        tallies
    }

    #[test]
    fn counts_are_read_by_name_and_divided_by_samples_and_electrodes() {
        let mut lines = lines();
        lines.reverse();
        let [fewest, most] = parsed(&lines).expect("the lines").per_sample(1);
        assert!((fewest - 1001.0 / 244.0).abs() < 1e-12);
        assert!((most - fewest).abs() < 1e-12);
    }

    #[test]
    fn one_instruction_more_on_one_input_is_not_constant() {
        assert!((0..NAMES.len()).all(|contender| sound().is_constant(contender)));
        let mut lines = lines();
        let last = NAMES.len() - 1;
        let line = lines.last_mut().expect("lines");
        *line = format!("count 1 {} 1006 1007 256257", NAMES[last]);
        let tallies = parsed(&lines).expect("the lines");
        assert!(!tallies.is_constant(last) && tallies.is_constant(0));
    }

    #[test]
    fn an_image_that_prints_something_else_is_refused() {
        type Break = fn(&mut Vec<String>);
        let broken: [(Break, &str); 5] = [
            (|lines| lines.truncate(3), "a line is missing"),
            (|lines| lines.push(lines[0].clone()), "came twice"),
            (
                |lines| lines.push("count 2 ours-blocks 1 1 256".to_owned()),
                "unknown",
            ),
            (
                |lines| lines.push("count 0 theirs 1 1 256".to_owned()),
                "unknown",
            ),
            (
                |lines| lines.push("panicked at".to_owned()),
                "panicked at",
            ),
        ];
        for (break_it, words) in broken {
            let mut lines = lines();
            break_it(&mut lines);
            let why = parsed(&lines).expect_err("broken");
            assert!(why.contains(words), "{why}");
        }
    }

    #[test]
    fn a_single_different_bit_is_counted_for_its_contender() {
        let expected = vec![0; 2 * NAMES.len() * BYTES];
        let mut output = expected.clone();
        output[(NAMES.len() + 2) * BYTES + 17] = 1;
        let mut counted = [0; NAMES.len()];
        counted[2] = 1;
        assert_eq!(different(&expected, &output), counted);
    }

    #[test]
    fn single_samples_must_give_the_output_of_blocks() {
        assert_eq!(
            NAMES[SINGLES - 1..=SINGLES],
            ["ours-blocks", "ours-singles"]
        );
        let mut outputs = vec![0; NAMES.len() * BYTES];
        outputs[SINGLES * BYTES] = 1;
        assert_eq!(different(&outputs, &outputs)[SINGLES], 1);
    }
}
