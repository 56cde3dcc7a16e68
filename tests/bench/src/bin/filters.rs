//! Image that counts the instructions of all contenders. The documentation of the library `bench`
//! describes the image's files.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

/// Built for a PC, the program only prints where it must run.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image runs on the emulated microcontroller: `cargo xtask bench filters`");
}

#[cfg(target_os = "none")]
mod image {
    use core::panic::PanicInfo;

    use bench::{
        block::{self, BLOCKS, BYTES, INPUTS, OUTPUTS},
        contenders::{NAMES, with_contenders},
        machine::{Clock, HostFile, Refused, exit, with_clock},
        tally::Tally,
    };
    use cortex_m_rt::entry;
    use cortex_m_semihosting::hprintln;

    #[entry]
    fn main() -> ! {
        with_clock(count_all)
    }

    /// Filters all inputs and prints, for each input, one tally for each contender in the order of `NAMES`.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        let mut inputs = HostFile::open(INPUTS)?;
        let mut outputs = HostFile::create(OUTPUTS)?;
        hprintln!("inputs = [");
        while let Some(tallies) = count_input(clock, &mut inputs, &mut outputs)? {
            hprintln!("{:?},", tallies);
        }
        hprintln!("]");
        Ok(())
    }

    /// Filters the next input. Returns a tally for each contender, or `None` at the end of the file.
    fn count_input(
        clock: &Clock,
        inputs: &mut HostFile,
        outputs: &mut HostFile,
    ) -> Result<Option<[Tally; NAMES.len()]>, Refused> {
        with_contenders(|mut contenders| {
            let mut tallies = [Tally::EMPTY; NAMES.len()];
            let mut bytes = [0; BYTES];
            for index in 0..BLOCKS {
                if !inputs.read(&mut bytes)? {
                    return if index == 0 { Ok(None) } else { Err(Refused) };
                }
                let input = block::from_bytes(&bytes);
                for (contender, tally) in contenders.iter_mut().zip(&mut tallies) {
                    contender.load(&input);
                    tally.add(clock.count(&mut || contender.run()));
                    outputs.write(&block::to_bytes(&contender.output()))?;
                }
            }
            Ok(Some(tallies))
        })
    }

    #[panic_handler]
    fn panic(info: &PanicInfo) -> ! {
        hprintln!("{}", info);
        exit(false)
    }
}
