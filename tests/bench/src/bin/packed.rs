//! Image that counts the instructions of each time step of the packed encoder.
//!
//! The input file starts with the number of time steps (32 bits, little endian); the filtered
//! electrodes of each step follow, 32 bits each. The output file holds, for each block, its length
//! in bytes (one byte) and the bytes.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

bench::image!("packed");

#[cfg(target_os = "none")]
mod image {
    use core::fmt;

    use bench::{
        machine::{Clock, Files, Refused, with_clock},
        tally::Tally,
    };
    use cortex_m_rt::entry;
    use cortex_m_semihosting::hprintln;
    use model::HOP;
    use pipeline::{ELECTRODES, PackedEncoder, PackedMemory, Step};

    /// Instruction tallies (fewest, most, total) of one input: `places` for each time step of a
    /// hop, `hops` over whole hops.
    struct Counts {
        places: [Tally; HOP],
        hops: Tally,
    }

    impl fmt::Debug for Counts {
        /// Writes the counts as an inline TOML table, which the report reads.
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            let Self { places, hops } = self;
            f.write_fmt(format_args!("{{ places = {places:?}, hops = {hops:?} }}"))
        }
    }

    #[entry]
    fn main() -> ! {
        with_clock(|clock| {
            hprintln!("ram_bytes = {}", size_of::<PackedMemory>());
            count_all(clock)
        })
    }

    /// Encodes all inputs. Prints, for each input, an instruction tally (fewest, most, total) for
    /// each time step of a hop, and one over whole hops.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        let mut files = Files::open()?;
        let steps = files.read_steps()?;
        files.count_inputs(|files| count_input(clock, steps, files))
    }

    /// Encodes the next input. Returns its counts, or `None` at the end of the file.
    fn count_input(
        clock: &Clock,
        steps: usize,
        files: &mut Files,
    ) -> Result<Option<Counts>, Refused> {
        let mut encoder = PackedEncoder::new();
        let (mut places, mut hops) = ([Tally::EMPTY; HOP], Tally::EMPTY);
        let mut bytes = [0; 4 * ELECTRODES];
        let mut hop = 0;
        for index in 0..steps {
            if !files.read(index, &mut bytes)? {
                return Ok(None);
            }
            let (values, _) = bytes.as_chunks();
            let step = Step {
                electrodes: core::array::from_fn(|electrode| i32::from_le_bytes(values[electrode])),
                ..Step::default()
            };
            let mut code = None;
            let instructions = clock.count(&mut || code = encoder.encode_step(&step));
            places[index % HOP].add(instructions);
            hop += instructions;
            if let Some(code) = code {
                hops.add(hop);
                hop = 0;
                let bytes = code.bytes();
                let length = u8::try_from(bytes.len()).unwrap_or(u8::MAX);
                files.outputs.write(&[length])?;
                files.outputs.write(bytes)?;
            }
        }
        Ok(Some(Counts { places, hops }))
    }
}
