//! What the encoder's image counted, and whether its codes are the PC's.

use bench::kernel::{self, SHORTCUT};
use bench::tally::Tally;
use model::{CODE, HOP};

use super::super::emulator::Machine;
use crate::failure::Failure;

/// Counts of one machine.
#[derive(Debug, Clone)]
pub(crate) struct Counts {
    /// The machine.
    pub(crate) machine: Machine,
    /// Per input and place in the hop.
    pub(crate) steps: Vec<[Tally; HOP]>,
    /// Instructions of one run of each kernel, in the order of [`kernel::each`].
    pub(crate) kernels: Vec<u32>,
    /// Instructions from one step to the next in the acquisition.
    pub(crate) acquisition: u32,
    /// Bytes of the acquisition's and the encoder's state.
    pub(crate) ram: [u32; 2],
    /// Codes that are not the PC's.
    pub(crate) different: usize,
}

impl Counts {
    /// Reads what the image said and what it wrote.
    ///
    /// # Errors
    /// Image and xtask do not fit together: a line that makes no sense, or a file of another length.
    pub(crate) fn new(
        machine: Machine,
        said: &[String],
        inputs: usize,
        expected: &[u8],
        came_out: &[u8],
    ) -> Result<Self, Failure> {
        let failed = |why: String| Failure::Check {
            what: format!("reading the counts of {}", machine.name),
            why,
            next: "image and xtask are of different age? `cargo clean --package bench`".to_owned(),
        };
        if came_out.len() != expected.len() {
            let (out, wanted) = (came_out.len(), expected.len());
            return Err(failed(format!("{out} bytes came out, {wanted} expected")));
        }
        let counts = Self::parse(machine, said, inputs).map_err(failed)?;
        let codes = came_out.chunks(CODE).zip(expected.chunks(CODE));
        Ok(Self {
            different: codes.filter(|(code, expected)| code != expected).count(),
            ..counts
        })
    }

    /// The lines that the image says, each once.
    fn parse(machine: Machine, said: &[String], inputs: usize) -> Result<Self, String> {
        let names = kernel_names();
        let mut steps = vec![[None; HOP]; inputs];
        let mut kernels = vec![None; names.len()];
        let (mut acquisition, mut ram) = (None, [None; 2]);
        for line in said {
            let wrong = || format!("the line {line:?}");
            let (kind, rest) = line.split_once(' ').ok_or_else(wrong)?;
            let was_there = match kind {
                "step" => {
                    let (place, tally) = place(&mut steps, rest).ok_or_else(wrong)?;
                    place.replace(tally).is_some()
                }
                "kernel" => {
                    let (count, name) = rest.split_once(' ').ok_or_else(wrong)?;
                    let index = names.iter().position(|known| *known == name);
                    let kernel = &mut kernels[index.ok_or_else(wrong)?];
                    kernel.replace(number(count).ok_or_else(wrong)?).is_some()
                }
                "acquisition" => acquisition
                    .replace(number(rest).ok_or_else(wrong)?)
                    .is_some(),
                "ram" => {
                    let (part, bytes) = rest.split_once(' ').ok_or_else(wrong)?;
                    let index = ["acquisition", "encoder"]
                        .iter()
                        .position(|known| *known == part);
                    let part = &mut ram[index.ok_or_else(wrong)?];
                    part.replace(number(bytes).ok_or_else(wrong)?).is_some()
                }
                _ => return Err(wrong()),
            };
            if was_there {
                return Err(format!("{line:?} came twice"));
            }
        }
        let missing = || "a line is missing".to_owned();
        let all = |tallies: [Option<Tally>; HOP]| -> Option<[Tally; HOP]> {
            let tallies: Vec<Tally> = tallies.into_iter().collect::<Option<_>>()?;
            tallies.try_into().ok()
        };
        let steps: Option<Vec<_>> = steps.into_iter().map(all).collect();
        let kernels: Option<Vec<u32>> = kernels.into_iter().collect();
        let [ram_acquisition, ram_encoder] = ram;
        Ok(Self {
            machine,
            steps: steps.ok_or_else(missing)?,
            kernels: kernels.ok_or_else(missing)?,
            acquisition: acquisition.ok_or_else(missing)?,
            ram: [
                ram_acquisition.ok_or_else(missing)?,
                ram_encoder.ok_or_else(missing)?,
            ],
            different: 0,
        })
    }

    /// Fewest and most instructions of the step at a place in the hop, over all inputs.
    pub(crate) fn step(&self, place: usize) -> [u32; 2] {
        let tallies = || self.steps.iter().map(|places| places[place]);
        let fewest = tallies().map(|tally| tally.fewest).min();
        let most = tallies().map(|tally| tally.most).max();
        [fewest.unwrap_or(0), most.unwrap_or(u32::MAX)]
    }

    /// The worst step over the mean of the best ones, each without `left_out` instructions.
    pub(crate) fn worst_over_mean(&self, left_out: u32) -> f64 {
        let step = |place, bound: usize| {
            let count: u32 = self.step(place)[bound];
            f64::from(count.saturating_sub(left_out))
        };
        let worst = (0..HOP).map(|place| step(place, 1)).fold(0.0, f64::max);
        let sum: f64 = (0..HOP).map(|place| step(place, 0)).sum();
        worst * f64::from(u32::try_from(HOP).unwrap_or(u32::MAX)) / sum
    }

    /// Instructions of one run of the shortcut.
    pub(crate) fn shortcut(&self) -> u32 {
        let index = kernel_names().iter().position(|name| *name == SHORTCUT);
        index.map_or(0, |index| self.kernels[index])
    }

    /// Whether every step takes as many instructions for every input.
    ///
    /// Not as many as the next hop's: a ring buffer's position may cost, what is in it may not.
    pub(crate) fn is_constant(&self) -> bool {
        self.steps.iter().all(|tallies| *tallies == self.steps[0])
    }
}

fn number(text: &str) -> Option<u32> {
    text.parse().ok()
}

/// Where the tally of a line `INPUT PLACE FEWEST MOST TOTAL` belongs.
fn place<'s>(
    steps: &'s mut [[Option<Tally>; HOP]],
    rest: &str,
) -> Option<(&'s mut Option<Tally>, Tally)> {
    let (input, rest) = rest.split_once(' ')?;
    let (place, tally) = rest.split_once(' ')?;
    let places = steps.get_mut(input.parse::<usize>().ok()?)?;
    let place = places.get_mut(place.parse::<usize>().ok()?)?;
    Some((place, Tally::parse(tally)?))
}

/// Names of the kernels, in their order.
pub(crate) fn kernel_names() -> Vec<&'static str> {
    let mut names = Vec::new();
    kernel::each(|kernel, _| names.push(kernel.name));
    names
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::super::emulator::MACHINES;
    use super::*;

    /// What an image says of two inputs: the last step of a hop takes 1500, all others 1000.
    pub(crate) fn said() -> Vec<String> {
        let mut said = vec![
            "ram acquisition 5000".to_owned(),
            "ram encoder 30000".to_owned(),
            "acquisition 900".to_owned(),
        ];
        said.extend(
            kernel_names()
                .iter()
                .map(|name| format!("kernel 100 {name}")),
        );
        for input in 0..2 {
            for place in 0..HOP {
                let count = if place == HOP - 1 { 1500 } else { 1000 };
                said.push(format!(
                    "step {input} {place} {count} {count} {}",
                    10 * count
                ));
            }
        }
        said
    }

    pub(crate) fn counts(said: &[String]) -> Counts {
        Counts::parse(MACHINES[0], said, 2).expect("the lines of an image")
    }

    #[test]
    fn counts_are_read_wherever_they_stand() {
        let mut said = said();
        said.reverse();
        let counts = counts(&said);
        assert_eq!(
            [counts.step(0), counts.step(HOP - 1)],
            [[1000; 2], [1500; 2]]
        );
        assert_eq!((counts.shortcut(), counts.acquisition), (100, 900));
        assert_eq!(counts.ram, [5000, 30_000]);
        assert!(counts.is_constant());
    }

    #[test]
    fn one_instruction_more_on_one_input_is_not_constant() {
        let mut said = said();
        let line = said.last_mut().expect("lines");
        *line = format!("step 1 {} 1500 1501 15001", HOP - 1);
        assert!(!counts(&said).is_constant());
        assert_eq!(counts(&said).step(HOP - 1), [1500, 1501]);
    }

    #[test]
    fn an_image_that_says_something_else_is_refused() {
        for (line, words) in [
            ("step 2 0 1 1 1", "step 2 0"),
            ("step 0 8 1 1 1", "step 0 8"),
            ("step 0 0 1 1 1", "came twice"),
            ("kernel 100 theirs", "theirs"),
            ("panicked at", "panicked at"),
        ] {
            let mut said = said();
            said.push(line.to_owned());
            let why = Counts::parse(MACHINES[0], &said, 2).expect_err("broken");
            assert!(why.contains(words), "{why}");
        }
        for place in [0, 2, 3, said().len() - 1] {
            let mut said = said();
            said.remove(place);
            let why = Counts::parse(MACHINES[0], &said, 2).expect_err("broken");
            assert_eq!(why, "a line is missing");
        }
    }

    #[test]
    fn a_single_bit_is_a_different_code_and_a_missing_one_is_refused() {
        let expected = vec![0; 3 * CODE];
        let mut came_out = expected.clone();
        came_out[CODE + 5] = 1;
        let counts = Counts::new(MACHINES[0], &said(), 2, &expected, &came_out).expect("counts");
        assert_eq!(counts.different, 1);
        assert!(Counts::new(MACHINES[0], &said(), 2, &expected, &came_out[CODE..]).is_err());
    }
}
