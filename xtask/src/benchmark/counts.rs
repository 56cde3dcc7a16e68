//! What an image counted, and whether its outputs are those of the portable filters.

use bench::block::{self, BYTES};
use bench::contender::NAMES;
use bench::tally::Tally;
use fixed_dsp::BLOCK;
use model::ELECTRODES;

use super::emulator::Machine;
use super::inputs::Inputs;
use crate::failure::Failure;

/// Place in [`NAMES`]; before it the same in blocks.
const SINGLES: usize = 1;

/// Counts of one machine.
#[derive(Debug)]
pub(crate) struct Counts {
    /// The machine.
    pub(crate) machine: Machine,
    /// Per contender and input.
    tallies: Vec<[Tally; NAMES.len()]>,
    /// Blocks of each contender whose bits are not those of the portable filters.
    pub(crate) different: [usize; NAMES.len()],
}

impl Counts {
    /// Reads what the image said and what it wrote.
    ///
    /// # Errors
    /// Image and xtask do not fit together: a line that makes no sense, or a file of another length.
    pub(crate) fn new(
        machine: Machine,
        said: &[String],
        inputs: &Inputs,
        expected: &[u8],
        came_out: &[u8],
    ) -> Result<Self, Failure> {
        let failed = |why: String| Failure::Check {
            what: format!("reading the counts of {}", machine.name),
            why,
            next: "image and xtask are of different age? `cargo clean --package bench`".to_owned(),
        };
        if came_out.len() != expected.len() {
            let why = format!(
                "{} bytes came out, {} expected",
                came_out.len(),
                expected.len()
            );
            return Err(failed(why));
        }
        let tallies = parse(said, inputs.names.len()).map_err(failed)?;
        Ok(Self {
            machine,
            tallies,
            different: different(expected, came_out),
        })
    }

    /// Fewest and most instructions per sample and electrode of one contender, over all inputs.
    pub(crate) fn per_sample(&self, contender: usize) -> [f64; 2] {
        let tallies = || self.tallies.iter().map(|tallies| tallies[contender]);
        let samples = f64::from(u32::try_from(BLOCK * ELECTRODES).unwrap_or(u32::MAX));
        let fewest = tallies().map(|tally| tally.fewest).min();
        let most = tallies().map(|tally| tally.most).max();
        [fewest, most].map(|count| count.map_or(f64::NAN, f64::from) / samples)
    }

    /// Whether every block has the bits of the portable filters.
    pub(crate) fn bits_are_equal(&self) -> bool {
        self.different.iter().all(|blocks| *blocks == 0)
    }

    /// Whether the contender takes as many instructions for every input.
    ///
    /// Not for every block: a ring buffer's position may cost, the samples in it may not.
    pub(crate) fn is_constant(&self, contender: usize) -> bool {
        let mut tallies = self.tallies.iter().map(|tallies| tallies[contender]);
        let first = tallies.next();
        tallies.all(|tally| Some(tally) == first)
    }
}

/// The lines `count INPUT CONTENDER FEWEST MOST TOTAL`, each pair of input and contender once.
fn parse(said: &[String], inputs: usize) -> Result<Vec<[Tally; NAMES.len()]>, String> {
    let mut tallies = vec![[None; NAMES.len()]; inputs];
    for line in said {
        let (input, name, tally) = fields(line).ok_or_else(|| format!("the line {line:?}"))?;
        let place = NAMES.iter().position(|known| *known == name);
        let place = place.and_then(|place| tallies.get_mut(input)?.get_mut(place));
        let place = place.ok_or_else(|| format!("{name} on input {input} is unknown"))?;
        if place.replace(tally).is_some() {
            return Err(format!("{name} on input {input} came twice"));
        }
    }
    let complete = tallies.into_iter().map(|tallies| {
        let missing = || "a line is missing".to_owned();
        let all: Option<Vec<Tally>> = tallies.into_iter().collect();
        all.and_then(|all| all.try_into().ok()).ok_or_else(missing)
    });
    complete.collect()
}

fn fields(line: &str) -> Option<(usize, &str, Tally)> {
    let rest = line.strip_prefix("count ")?;
    let (input, rest) = rest.split_once(' ')?;
    let (name, tally) = rest.split_once(' ')?;
    Some((input.parse().ok()?, name, Tally::parse(tally)?))
}

/// Blocks that are not equal, by contender; single samples have to give what blocks give.
fn different(expected: &[u8], came_out: &[u8]) -> [usize; NAMES.len()] {
    let blocks = |bytes: &[u8]| -> Vec<block::Block> {
        let blocks = bytes.as_chunks::<BYTES>().0.iter();
        blocks.map(block::from_bytes).collect()
    };
    let (expected, came_out) = (blocks(expected), blocks(came_out));
    let mut different = [0; NAMES.len()];
    for (index, block) in came_out.iter().enumerate() {
        let contender = index % NAMES.len();
        let twin = if contender == SINGLES {
            index - 1
        } else {
            index
        };
        different[contender] += usize::from(expected[twin] != *block);
    }
    different
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What an image says of two inputs: every contender takes its place's number and 1000 more.
    fn said() -> Vec<String> {
        let line = |input: u32, place: usize| {
            let count = 1000 + place;
            format!(
                "count {input} {} {count} {count} {}",
                NAMES[place],
                256 * count
            )
        };
        let inputs = (0..2).flat_map(|input| (0..NAMES.len()).map(move |place| line(input, place)));
        inputs.collect()
    }

    fn counts(said: &[String]) -> Counts {
        Counts {
            machine: super::super::emulator::MACHINES[0],
            tallies: parse(said, 2).expect("the lines of an image"),
            different: [0; NAMES.len()],
        }
    }

    #[test]
    fn counts_are_read_by_name_and_given_per_sample_and_electrode() {
        let mut said = said();
        said.reverse();
        let [fewest, most] = counts(&said).per_sample(1);
        assert!((fewest - 1001.0 / 244.0).abs() < 1e-12);
        assert!((most - fewest).abs() < 1e-12);
    }

    #[test]
    fn one_instruction_more_on_one_input_is_not_constant() {
        let mut said = said();
        assert!((0..NAMES.len()).all(|contender| counts(&said).is_constant(contender)));
        let last = NAMES.len() - 1;
        let line = said.last_mut().expect("lines");
        *line = format!("count 1 {} 1006 1007 256257", NAMES[last]);
        assert!(!counts(&said).is_constant(last) && counts(&said).is_constant(0));
    }

    #[test]
    fn an_image_that_says_something_else_is_refused() {
        type Break = fn(&mut Vec<String>);
        let broken: [(Break, &str); 5] = [
            (|said| said.truncate(3), "a line is missing"),
            (|said| said.push(said[0].clone()), "came twice"),
            (
                |said| said.push("count 2 ours-blocks 1 1 256".to_owned()),
                "unknown",
            ),
            (
                |said| said.push("count 0 theirs 1 1 256".to_owned()),
                "unknown",
            ),
            (|said| said.push("panicked at".to_owned()), "panicked at"),
        ];
        for (break_it, words) in broken {
            let mut said = said();
            break_it(&mut said);
            let why = parse(&said, 2).expect_err("broken");
            assert!(why.contains(words), "{why}");
        }
    }

    #[test]
    fn a_single_bit_in_a_block_is_noticed_and_blamed_on_its_contender() {
        let expected = vec![0; 2 * NAMES.len() * BYTES];
        let mut came_out = expected.clone();
        came_out[(NAMES.len() + 2) * BYTES + 17] = 1;
        let mut blamed = [0; NAMES.len()];
        blamed[2] = 1;
        assert_eq!(different(&expected, &came_out), blamed);
    }

    #[test]
    fn single_samples_have_to_give_what_blocks_give() {
        assert_eq!(
            NAMES[SINGLES - 1..=SINGLES],
            ["ours-blocks", "ours-singles"]
        );
        let mut outputs = vec![0; NAMES.len() * BYTES];
        outputs[SINGLES * BYTES] = 1;
        assert_eq!(different(&outputs, &outputs)[SINGLES], 1);
    }
}
