//! Inputs of the filters: silence, rails, noise, EEG.

use fixed_dsp::BLOCK;
use model::{CHANNELS, ELECTRODES, GUARD_BITS};
use pipeline::Sample;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::block::{self, BLOCKS, Block};
use crate::report::eeg::{self, Counts};
use crate::report::failure::Failure;

/// Real EEG below the folder in `CORTICODE_DATA`: 61 electrodes at 512 Hz.
const REAL: &str = "derived/s001r04_61ch_512hz_i16.gdf";

/// Samples of an input.
const SAMPLES: usize = BLOCKS * BLOCK;

/// Blocks of all inputs.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    pub(crate) names: Vec<&'static str>,
    /// [`BLOCKS`] blocks of each input.
    pub(crate) blocks: Vec<Block>,
    /// Contents of the input file.
    pub(crate) bytes: Vec<u8>,
    /// Inputs that are left out, with the reason.
    pub(crate) skipped: Vec<String>,
}

impl Inputs {
    /// Makes the inputs, the same on every run.
    ///
    /// # Errors
    /// `CORTICODE_DATA` is set and its recording cannot be read.
    pub(crate) fn new() -> Result<Self, Failure> {
        let mut inputs = Self::default();
        inputs.add("silence", std::iter::repeat([0; CHANNELS]));
        inputs.add("rails", telegraph(ChaCha8Rng::seed_from_u64(1)));
        inputs.add("noise", white(ChaCha8Rng::seed_from_u64(2)));
        inputs.add("synthetic EEG", eeg::synthetic()?);
        match eeg::recording(REAL) {
            Ok(path) => {
                let samples = eeg::recorded(&path, SAMPLES)?;
                if samples.len() < SAMPLES {
                    return Err(Failure::input(format!("{} is too short", path.display())));
                }
                inputs.add("real EEG", samples);
            }
            Err(reason) => inputs.skipped.push(reason),
        }
        Ok(inputs)
    }

    fn add(&mut self, name: &'static str, samples: impl IntoIterator<Item = Counts>) {
        self.names.push(name);
        let samples: Vec<Counts> = samples.into_iter().take(SAMPLES).collect();
        for four in samples.as_chunks::<BLOCK>().0 {
            let block: Block = std::array::from_fn(|electrode| {
                std::array::from_fn(|sample| four[sample][electrode] << GUARD_BITS)
            });
            self.blocks.push(block);
            self.bytes.extend(block::to_bytes(&block));
        }
    }
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
