//! Image that counts the instructions of the lossless compression of samples. The documentation of the library
//! `bench` describes the image's files.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

/// Built for a PC, the program only prints where it must run.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image runs on the emulated microcontroller: `cargo xtask bench lossless`");
}

#[cfg(target_os = "none")]
mod image {
    use core::panic::PanicInfo;

    use bench::{
        block::{INPUTS, OUTPUTS},
        compression::{BLOCKS, ENCODER, INPUT_BYTES, SILENCE, from_bytes, to_bytes},
        machine::{Clock, HostFile, Refused, exit, with_clock},
        tally::Tally,
    };
    use cortex_m_rt::entry;
    use cortex_m_semihosting::hprintln;
    use lossless::{Block, EncoderState, Kind};
    use model::CHANNELS;

    #[entry]
    fn main() -> ! {
        with_clock(count_all)
    }

    /// Compresses all inputs and prints a tally for each.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        hprintln!("state_bytes = {}", size_of::<EncoderState<CHANNELS>>());
        let mut inputs = HostFile::open(INPUTS)?;
        let mut outputs = HostFile::create(OUTPUTS)?;
        hprintln!("inputs = [");
        while let Some(tally) = count_input(clock, &mut inputs, &mut outputs)? {
            hprintln!("{:?},", tally);
        }
        hprintln!("]");
        Ok(())
    }

    /// Compresses the next input. Returns `None` at the end of the file.
    fn count_input(
        clock: &Clock,
        inputs: &mut HostFile,
        outputs: &mut HostFile,
    ) -> Result<Option<Tally>, Refused> {
        let mut state = EncoderState::NEW;
        let mut tally = Tally::EMPTY;
        let mut bytes = [0; INPUT_BYTES];
        for index in 0..BLOCKS {
            if !inputs.read(&mut bytes)? {
                return if index == 0 { Ok(None) } else { Err(Refused) };
            }
            let samples = from_bytes(&bytes);
            let mut room = SILENCE;
            let (mut kind, mut length) = (Kind::Verbatim, 0);
            tally.add(clock.count(&mut || {
                let block = ENCODER.encode(&mut state, &samples, &mut room);
                (kind, length) = (block.kind, block.bytes.len());
            }));
            let bytes = room.as_flattened().as_flattened();
            outputs.write(&to_bytes(&Block {
                kind,
                samples: samples.len(),
                bytes: &bytes[..length],
            }))?;
        }
        Ok(Some(tally))
    }

    #[panic_handler]
    fn panic(info: &PanicInfo) -> ! {
        hprintln!("{}", info);
        exit(false)
    }
}
