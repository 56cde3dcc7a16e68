//! Inputs of the filters: silence, rails, noise, EEG.

use fixed_dsp::BLOCK;
use model::{CHANNELS, ELECTRODES, GUARD_BITS};
use pipeline::Sample;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::block::{BLOCKS, Block};
use crate::report::failure::Failure;
use crate::report::inputs::{self, Counts, Inputs};

/// Real EEG below the folder in `CORTICODE_DATA`: 61 electrodes at 512 Hz.
const REAL: &str = "derived/s001r04_61ch_512hz_i16.gdf";

/// Number of samples in an input: 2 s.
const SAMPLES: usize = BLOCKS * BLOCK;

/// Makes [`BLOCKS`] blocks of each input, the same on every run.
///
/// # Errors
/// `CORTICODE_DATA` is set and its recording cannot be read.
pub(crate) fn inputs() -> Result<Inputs<Block>, Failure> {
    let mut inputs = Inputs::new();
    inputs.add("silence", blocks(std::iter::repeat([0; CHANNELS])));
    inputs.add("rails", blocks(telegraph(ChaCha8Rng::seed_from_u64(1))));
    inputs.add("noise", blocks(white(ChaCha8Rng::seed_from_u64(2))));
    inputs.add("synthetic EEG", blocks(inputs::synthetic()?));
    match inputs::recording(REAL) {
        Ok(path) => {
            let samples = inputs::recorded(&path, SAMPLES)?;
            if samples.len() < SAMPLES {
                return Err(Failure::input(format!("{} is too short", path.display())));
            }
            inputs.add("real EEG", blocks(samples));
        }
        Err(reason) => inputs.skipped.push(reason),
    }
    Ok(inputs)
}

fn blocks(samples: impl IntoIterator<Item = Counts>) -> Vec<Block> {
    let samples: Vec<Counts> = samples.into_iter().take(SAMPLES).collect();
    let blocks = samples.as_chunks::<BLOCK>().0.iter().map(|four| {
        std::array::from_fn(|electrode| four.map(|counts| counts[electrode] << GUARD_BITS))
    });
    blocks.collect()
}

/// Random telegraph signal: every electrode jumps from rail to rail, 25 times per second on average.
fn telegraph(mut random: ChaCha8Rng) -> impl Iterator<Item = Counts> {
    let mut counts = [Sample::MAX; CHANNELS];
    std::iter::repeat_with(move || {
        for count in &mut counts[..ELECTRODES] {
            if random.random_ratio(1, 20) {
                // The other rail: !MAX is -MAX - 1.
                *count = !*count;
            }
        }
        counts
    })
}

/// White noise over the whole range of 24 bits.
fn white(mut random: ChaCha8Rng) -> impl Iterator<Item = Counts> {
    std::iter::repeat_with(move || std::array::from_fn(|_| random.next_u32().cast_signed() >> 8))
}
