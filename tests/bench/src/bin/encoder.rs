//! Image that counts the instructions of each time step of the encoder. The documentation of the
//! library `bench` describes the image's files.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

bench::image!("encoder");

#[cfg(target_os = "none")]
mod image {
    use bench::{
        hop::FILLING,
        kernel::{self, Kernel},
        machine::{Clock, Files, Refused, with_clock},
        tally::Tally,
    };
    use cortex_m_rt::entry;
    use cortex_m_semihosting::hprintln;
    use model::HOP;
    use pipeline::{Acquisition, CELLS, CodeValues, Encoder, Mains, Sample, Step};

    #[entry]
    fn main() -> ! {
        with_clock(|clock| {
            let ram_bytes = size_of::<Acquisition>() + size_of::<Encoder<'_>>();
            hprintln!("ram_bytes = {}", ram_bytes);
            count_acquisition(clock);
            hprintln!("kernels = [");
            kernel::each(|Kernel { name, per_code }, run| {
                let count = per_code * clock.count(run);
                hprintln!("{{ name = {:?}, insn_per_code = {} }},", name, count);
            });
            hprintln!("]");
            count_all(clock)
        })
    }

    /// Prints the number of the acquisition's instructions in a hop. Counts only one time step: the
    /// image `filters` shows that the number is the same for every signal.
    fn count_acquisition(clock: &Clock) {
        let mut acquisition = Acquisition::new(Mains::Hz50);
        let sample = Sample::default();
        let mut step = acquisition.process_sample(&sample);
        let count = clock.count(&mut || {
            step = None;
            while step.is_none() {
                step = acquisition.process_sample(&sample);
            }
        });
        hprintln!("acquisition_per_code = {}", count as usize * HOP);
    }

    /// Encodes all inputs. Prints, for each input, an instruction tally (fewest, most, total) for
    /// each time step of a hop.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        let mut files = Files::open()?;
        let steps = files.read_steps()?;
        files.count_inputs(|files| count_input(clock, steps, files))
    }

    /// Encodes the next input. Returns the tally of each time step of a hop, or `None` at the end
    /// of the file.
    fn count_input(
        clock: &Clock,
        steps: usize,
        files: &mut Files,
    ) -> Result<Option<[Tally; HOP]>, Refused> {
        let mut encoder = Encoder::new();
        let mut tallies = [Tally::EMPTY; HOP];
        let mut bytes = [0; CELLS];
        for index in 0..steps {
            if !files.read(index, &mut bytes)? {
                return Ok(None);
            }
            let step = Step { plane: bytes.map(u8::cast_signed), ..Step::default() };
            let mut code = None;
            let instructions = clock.count(&mut || code = encoder.encode_step(&step));
            if index >= FILLING {
                tallies[index % HOP].add(instructions);
            }
            if let Some(code) = code {
                files.outputs.write(code.values.to_bytes(&mut [0; CodeValues::MAX_BYTES]))?;
            }
        }
        Ok(Some(tallies))
    }
}
