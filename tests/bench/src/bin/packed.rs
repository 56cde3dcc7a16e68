//! Image that counts the instructions of each time step of the packed encoder.
//!
//! The input file holds the number of time steps, 32 bits, little endian, then the filtered electrodes of each
//! step, 32 bits each. The output file holds, for each block, the number of its bytes and the bytes.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

/// Built for a PC, the program only prints where it must run.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image runs on the emulated microcontroller: `cargo xtask bench packed`");
}

#[cfg(target_os = "none")]
mod image {
    use core::panic::PanicInfo;

    use bench::{
        block::{INPUTS, OUTPUTS},
        machine::{Clock, HostFile, Refused, exit, with_clock},
        tally::Tally,
    };
    use cortex_m_rt::entry;
    use cortex_m_semihosting::hprintln;
    use model::HOP;
    use pipeline::{ELECTRODES, PackedEncoder, PackedMemory, Step};

    #[entry]
    fn main() -> ! {
        with_clock(|clock| {
            hprintln!("ram_bytes = {}", size_of::<PackedMemory>());
            count_all(clock)
        })
    }

    /// Encodes all inputs and prints, for each input, a tally for each place in the hop and one for whole hops.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        let mut inputs = HostFile::open(INPUTS)?;
        let mut outputs = HostFile::create(OUTPUTS)?;
        let mut steps = [0; 4];
        if !inputs.read(&mut steps)? {
            return Err(Refused);
        }
        let steps = u32::from_le_bytes(steps) as usize;
        hprintln!("inputs = [");
        while let Some((places, hops)) = count_input(clock, steps, &mut inputs, &mut outputs)? {
            hprintln!("{{ places = {:?}, hops = {:?} }},", places, hops);
        }
        hprintln!("]");
        Ok(())
    }

    /// Encodes the next input; `None` at the end of the file.
    fn count_input(
        clock: &Clock,
        steps: usize,
        inputs: &mut HostFile,
        outputs: &mut HostFile,
    ) -> Result<Option<([Tally; HOP], Tally)>, Refused> {
        let mut encoder = PackedEncoder::new();
        let (mut places, mut hops) = ([Tally::EMPTY; HOP], Tally::EMPTY);
        let mut bytes = [0; 4 * ELECTRODES];
        let mut hop = 0;
        for index in 0..steps {
            if !inputs.read(&mut bytes)? {
                return if index == 0 { Ok(None) } else { Err(Refused) };
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
                outputs.write(&[length])?;
                outputs.write(bytes)?;
            }
        }
        Ok(Some((places, hops)))
    }

    #[panic_handler]
    fn panic(info: &PanicInfo) -> ! {
        hprintln!("{}", info);
        exit(false)
    }
}
