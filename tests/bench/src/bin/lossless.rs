//! Image that counts the instructions of the lossless compression of samples. The documentation of
//! the library `bench` describes the image's files.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

bench::image!("lossless");

#[cfg(target_os = "none")]
mod image {
    use bench::{
        compression::{BLOCKS, ENCODER, INPUT_BYTES, SILENCE, from_bytes, to_bytes},
        machine::{Clock, Files, Refused, with_clock},
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

    /// Compresses all inputs. Prints one instruction tally for each input, over all of its blocks.
    fn count_all(clock: &Clock) -> Result<(), Refused> {
        hprintln!("state_bytes = {}", size_of::<EncoderState<CHANNELS>>());
        let mut files = Files::open()?;
        files.count_inputs(|files| count_input(clock, files))
    }

    /// Compresses the next input. Returns its instruction tally, or `None` at the end of the file.
    fn count_input(clock: &Clock, files: &mut Files) -> Result<Option<Tally>, Refused> {
        let mut state = EncoderState::NEW;
        let mut tally = Tally::EMPTY;
        let mut bytes = [0; INPUT_BYTES];
        for index in 0..BLOCKS {
            if !files.read(index, &mut bytes)? {
                return Ok(None);
            }
            let samples = from_bytes(&bytes);
            let mut room = SILENCE;
            let (mut kind, mut length) = (Kind::Verbatim, 0);
            tally.add(clock.count(&mut || {
                let block = ENCODER.encode(&mut state, &samples, &mut room);
                (kind, length) = (block.kind, block.bytes.len());
            }));
            let bytes = room.as_flattened().as_flattened();
            files.outputs.write(&to_bytes(&Block {
                kind,
                samples: samples.len(),
                bytes: &bytes[..length],
            }))?;
        }
        Ok(Some(tally))
    }
}
