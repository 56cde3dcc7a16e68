//! Image that counts the instructions of all contenders, the compared filters. The documentation of
//! the library `bench` describes the image's files.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

bench::image!("filters");

#[cfg(target_os = "none")]
mod image {
    use bench::{
        block::{self, BLOCKS, BYTES},
        contenders::{NAMES, with_contenders},
        machine::{Clock, Files, Refused, with_clock},
        tally::Tally,
    };
    use cortex_m_rt::entry;

    #[entry]
    fn main() -> ! {
        with_clock(count_all)
    }

    /// Filters all inputs. Prints, for each input, the instruction tallies (fewest, most, total) of
    /// the contenders, in the order of `NAMES`.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        let mut files = Files::open()?;
        files.count_inputs(|files| count_input(clock, files))
    }

    /// Filters the next input. Returns the contenders' tallies, or `None` at the end of the file.
    fn count_input(
        clock: &Clock,
        files: &mut Files,
    ) -> Result<Option<[Tally; NAMES.len()]>, Refused> {
        with_contenders(|mut contenders| {
            let mut tallies = [Tally::EMPTY; NAMES.len()];
            let mut bytes = [0; BYTES];
            for index in 0..BLOCKS {
                if !files.read(index, &mut bytes)? {
                    return Ok(None);
                }
                let input = block::from_bytes(&bytes);
                for (contender, tally) in contenders.iter_mut().zip(&mut tallies) {
                    contender.load(&input);
                    tally.add(clock.count(&mut || contender.run()));
                    files.outputs.write(&block::to_bytes(&contender.output()))?;
                }
            }
            Ok(Some(tallies))
        })
    }
}
